# SPDX-License-Identifier: Apache-2.0
"""Folders of pictures as recordings: TUM RGB-D, ScanNet, Record3D, Stray Scanner."""
