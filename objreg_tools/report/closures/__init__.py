# SPDX-License-Identifier: Apache-2.0
"""What constraints close, by which objects, and what spoke for each."""
