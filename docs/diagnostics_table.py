# SPDX-License-Identifier: Apache-2.0
"""Writes the tables of what each node reports into docs/diagnostics.md.

python -m docs.diagnostics_table
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from objreg_mapper.adapters.diagnostics import AdapterDiagnostics, G2oDiagnostics, RtabmapDiagnostics
from objreg_mapper.diagnostics import MapperDiagnostics
from objreg_ros.blackbox.diagnostics import BlackboxDiagnostics
from objreg_ros.bridge.node.common import CommonDiagnostics, StreamDiagnostics
from objreg_ros.diagnostics import Declaration, Diagnostics
from objreg_ros.keyframes.diagnostics import KeyframerDiagnostics
from objreg_ros.registrar.diagnostics import RegistrarDiagnostics
from objreg_ros.segmenter.diagnostics import SegmenterDiagnostics

PAGE = Path(__file__).parent / "diagnostics.md"
BEGIN, END = "<!-- made by docs/diagnostics_table.py -->", "<!-- end of what was made -->"

COMMON: tuple[type[Diagnostics], ...] = (CommonDiagnostics,)
OWN: dict[str, tuple[type[Diagnostics], ...]] = {
    "detector": (),
    "segmenter": (StreamDiagnostics, SegmenterDiagnostics),
    "registrar": (StreamDiagnostics, RegistrarDiagnostics),
    "keyframer": (StreamDiagnostics, KeyframerDiagnostics),
    "blackbox": (BlackboxDiagnostics,),
    "mapper": (MapperDiagnostics,),
    "objreg_to_rtabmap": (AdapterDiagnostics, RtabmapDiagnostics),
    "objreg_to_lio_sam": (AdapterDiagnostics,),
    "objreg_to_hydra": (AdapterDiagnostics,),
    "objreg_to_g2o": (AdapterDiagnostics, G2oDiagnostics),
}
"""What each node reports beside what all have in common, by its name."""


def page_text(page: str) -> str:
    """The page with the tables made anew."""
    before, _, rest = page.partition(BEGIN)
    return f"{before}{BEGIN}\n\n{tables()}\n{END}{rest.partition(END)[2]}"


def tables() -> str:
    """A table for every node and one for each, in Markdown; none for a node that adds nothing."""
    sections = [*_section("Every node", COMMON)]
    for node, kinds in OWN.items():
        sections += _section(f"`{node}`", kinds) if kinds else [f"## `{node}`", "", "What every node reports.", ""]
    return "\n".join(sections)


def _section(title: str, kinds: Sequence[type[Diagnostics]]) -> Iterator[str]:
    yield from (f"## {title}", "", "| key | unit | meaning |", "| --- | --- | --- |")
    yield from (_row(declaration) for kind in kinds for declaration in kind.declarations())
    yield ""


def _row(declaration: Declaration) -> str:
    return f"| `{declaration.key}` | {declaration.unit} | {declaration.doc} |"


if __name__ == "__main__":
    PAGE.write_text(page_text(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
