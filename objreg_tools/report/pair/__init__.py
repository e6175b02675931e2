# SPDX-License-Identifier: Apache-2.0
"""Two frames registered, with all that was asked about them: as numbers and as a page."""
