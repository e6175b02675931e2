# SPDX-License-Identifier: Apache-2.0
"""`python -m objreg_ros.cli`, where the executable `objreg` is not installed."""

from objreg_ros.__main__ import main

main()
