# SPDX-License-Identifier: Apache-2.0
"""The detector stage: colour image in, Detections out."""
