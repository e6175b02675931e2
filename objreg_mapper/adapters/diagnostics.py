# SPDX-License-Identifier: Apache-2.0
"""What the adapters report beside what nodes have in common."""

from __future__ import annotations

from dataclasses import dataclass

from objreg_ros.diagnostics import Diagnostics, reading


@dataclass(frozen=True, kw_only=True)
class AdapterDiagnostics(Diagnostics):
    """What every adapter reports."""

    repeated: int = reading("repeated", "Constraints that came before.", "constraints")
    retracted: int = reading("retracted", "Withdrawals that came.", "constraints")
    retracted_late: int = reading(
        "retracted too late", "Those of constraints that the consumer has and cannot give up.", "constraints"
    )


@dataclass(frozen=True, kw_only=True)
class G2oDiagnostics(Diagnostics):
    """What the file has."""

    vertices: int = reading("vertices", "Keyframes in the graph.", "keyframes")
    constraints: int = reading("constraints in the file", "Constraints in the graph.", "constraints")


@dataclass(frozen=True, kw_only=True)
class RtabmapDiagnostics(Diagnostics):
    """What is known of RTAB-Map."""

    nodes: int = reading("nodes of rtabmap", "Nodes of its graph that are known.", "nodes")
    databases: int = reading("other databases", "How often another database took the place of the one before.")
    answers: bool = reading("add_link", "Whether its service `add_link` is there.")
