# SPDX-License-Identifier: Apache-2.0
"""The tables in docs/diagnostics.md are those of the code, and have all that a node publishes."""

from __future__ import annotations

import importlib
import re
from pathlib import Path

import pytest

from docs.diagnostics_table import BEGIN, COMMON, END, OWN, PAGE, page_text
from objreg_ros.diagnostics import Diagnostics

CLASSES = {
    "detector": "objreg_ros.detector.node.DetectorNode",
    "segmenter": "objreg_ros.segmenter.node.SegmenterNode",
    "registrar": "objreg_ros.registrar.node.RegistrarNode",
    "keyframer": "objreg_ros.keyframes.node.KeyframerNode",
    "blackbox": "objreg_ros.blackbox.node.BlackboxNode",
    "mapper": "objreg_mapper.node.MapperNode",
    "objreg_to_rtabmap": "objreg_mapper.adapters.rtabmap.ToRtabmap",
    "objreg_to_lio_sam": "objreg_mapper.adapters.lio_sam.ToLioSam",
    "objreg_to_hydra": "objreg_mapper.adapters.hydra.ToHydra",
    "objreg_to_g2o": "objreg_mapper.adapters.g2o.ToG2o",
}


def made_by(node: type) -> set[str]:
    """The kinds of diagnostics that a node and its base classes make, by the names in their code."""
    methods = [vars(one)["own_diagnostics"] for one in node.__mro__ if "own_diagnostics" in vars(one)]
    return {name for method in methods for name in method.__code__.co_names if name.endswith("Diagnostics")}


def test_the_page_is_that_of_the_code() -> None:
    page = PAGE.read_text(encoding="utf-8")
    assert page == page_text(page), "make it anew: python -m docs.diagnostics_table"


def test_only_what_is_between_the_marks_is_made() -> None:
    made = page_text(f"mine\n{BEGIN}\nold\n{END}\nmine too\n")
    assert made.startswith("mine\n") and made.endswith("\nmine too\n") and "\nold\n" not in made


@pytest.mark.parametrize("node", OWN)
def test_the_table_of_a_node_has_every_kind_that_it_reports(node: str) -> None:
    pytest.importorskip("rclpy")
    module, _, name = CLASSES[node].rpartition(".")
    assert made_by(getattr(importlib.import_module(module), name)) == {kind.__name__ for kind in OWN[node]}


def test_no_file_declares_diagnostics_that_no_node_reports(repository: Path) -> None:
    declared = {kind.__name__ for kind in Diagnostics.__subclasses__() if kind.__module__.startswith("objreg_")}
    assert declared == {kind.__name__ for kinds in (COMMON, *OWN.values()) for kind in kinds}
    files = {path.relative_to(repository) for path in repository.glob("objreg_*/**/*.py")
             if re.search(r"^class \w+\(Diagnostics\):", path.read_text(encoding="utf-8"), re.M)}  # fmt: skip
    known = {kind.__module__.replace(".", "/") + ".py" for kind in Diagnostics.__subclasses__()}
    assert {str(file) for file in files} <= known


@pytest.mark.parametrize("node", OWN)
def test_no_key_of_a_node_is_declared_twice(node: str) -> None:
    keys = [declaration.key for kind in (*COMMON, *OWN[node]) for declaration in kind.declarations()]
    assert len(keys) == len(set(keys))


def test_every_declaration_is_one_cell_of_a_table() -> None:
    for kind in {kind for kinds in (COMMON, *OWN.values()) for kind in kinds}:
        for one in kind.declarations():
            assert one.doc.endswith(".") and not set("|\n") & set(one.key + one.unit + one.doc), one.name
