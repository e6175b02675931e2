# SPDX-License-Identifier: Apache-2.0
"""The page of a run: its sections, figures, pairs and pictures, and what was found."""
