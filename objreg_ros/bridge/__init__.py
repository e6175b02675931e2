# SPDX-License-Identifier: Apache-2.0
"""The border: ROS messages to the words of data.py and back. No algorithm lives here."""
