# SPDX-License-Identifier: Apache-2.0
"""The only place that says yes: the `verdict` on a candidate by its evidence."""
