# SPDX-License-Identifier: Apache-2.0
"""The page and the table of a sweep over parameters: what each combination found, and which is best."""
