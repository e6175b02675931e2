# SPDX-License-Identifier: Apache-2.0
"""The direction of up: by level surfaces or by an IMU, with its deviation."""
