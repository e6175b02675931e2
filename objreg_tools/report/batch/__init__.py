# SPDX-License-Identifier: Apache-2.0
"""The page and the tables of many recordings."""
