# SPDX-License-Identifier: Apache-2.0
"""`python -m objreg_tools.cli`, where the executable `objreg` is not installed."""

from objreg_tools.__main__ import main

main()
