# SPDX-License-Identifier: Apache-2.0
"""Recordings in and out: rosbag1, rosbag2 (sqlite3, mcap) and TUM RGB-D folders behind one reader."""
