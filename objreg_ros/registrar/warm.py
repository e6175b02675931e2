# SPDX-License-Identifier: Apache-2.0
"""Compiles or loads every kernel of the registrar before the first frame comes."""

from __future__ import annotations

from objreg_ros.keyframes.warm import drawn
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registrar.registrar import Registrar

GAP_S = 1.0  # beyond the least gap between two keyframes of a constraint


def warm(params: RegistrarParams) -> None:
    """Let a registrar of its own, with nothing stored, meet the same drawn place twice."""
    gap_ns = round((params.min_gap + GAP_S) * 1e9)
    registrar = Registrar(params.replaced(store=""))
    for start_ns in (0, gap_ns):
        registrar.process(drawn(start_ns))
        registrar.process(drawn(start_ns + 1))
        registrar.finish()
    registrar.close()
