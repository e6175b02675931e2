# SPDX-License-Identifier: Apache-2.0
"""Pictures and tables of a run, and its map as files that other programs read."""
