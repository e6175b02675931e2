# SPDX-License-Identifier: Apache-2.0
"""Which direction is up: by level surfaces or by an IMU, with its deviation."""
