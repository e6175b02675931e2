# SPDX-License-Identifier: Apache-2.0
"""rosbag1 and rosbag2: their files, messages and errors, and what a compressed one may become."""
