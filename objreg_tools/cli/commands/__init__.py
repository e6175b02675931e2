# SPDX-License-Identifier: Apache-2.0
"""The commands of `objreg`, one file each, imported when it is called."""
