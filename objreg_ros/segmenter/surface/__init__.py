# SPDX-License-Identifier: Apache-2.0
"""The depth image as a surface: cells, their connected parts, seams and holes, and the level planes."""
