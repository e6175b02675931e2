# SPDX-License-Identifier: Apache-2.0
"""The commands of `objreg` that work on a store of the registrar."""
