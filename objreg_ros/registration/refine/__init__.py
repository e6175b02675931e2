# SPDX-License-Identifier: Apache-2.0
"""Refinement: `batch_icp` brings many poses to their basins, `photometric_icp` ends a few by their grey."""
