# SPDX-License-Identifier: Apache-2.0
"""A person who reads a reason can read what it means, what to do, and what to set."""

from __future__ import annotations

import importlib
import re
from pathlib import Path

from objreg_ros.bridge.streams.sync import Drop
from objreg_ros.data.closures import Reason
from objreg_tools.report.run.reasons import DROPS, MEANINGS, REFUSALS, ReasonText

ALL = {**REFUSALS, **DROPS}


def parameters(repository: Path) -> set[str]:
    """Every parameter by ``node.name``, as docs/parameters.md lists them."""
    sections = (repository / "docs/parameters.md").read_text(encoding="utf-8").split("\n## `")[1:]
    own = {
        f"{section.partition('`')[0]}.{name}"
        for section in sections
        for name in re.findall(r"^\| `(\w+)`", section.partition("\n## ")[0], re.MULTILINE)
    }
    return own | {"detector.max_megapixels"}  # one of every node


def test_every_reason_has_its_meaning() -> None:
    assert set(MEANINGS) == {reason.value for reason in Reason}


def test_every_drop_has_its_meaning(repository: Path) -> None:
    page = (repository / "docs/wire.md").read_text(encoding="utf-8")
    table = page.partition("## Why a frame or a constraint is dropped")[2].partition("\n## ")[0]
    named = set(re.findall(r"^\| `(\w+)", table, re.MULTILINE))
    assert {name.removesuffix("_") for name in named} == set(DROPS) and set(DROPS) >= {drop.value for drop in Drop}


def test_a_reason_says_what_to_do_and_names_parameters_and_limits_that_exist(repository: Path) -> None:
    for name in ALL:
        text: ReasonText = ALL[name]
        assert text.meaning and not text.meaning.endswith(".") and text.remedy.endswith("."), name
        assert set(text.parameters) <= parameters(repository), name
        for file, limit in text.limits:
            module = "objreg_ros." + file.removesuffix(".py").replace("/", ".")
            assert hasattr(importlib.import_module(module), limit), f"{module} has no {limit}"
