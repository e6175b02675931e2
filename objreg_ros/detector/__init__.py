# SPDX-License-Identifier: Apache-2.0
"""Room 1: colour image in, Detections out."""
