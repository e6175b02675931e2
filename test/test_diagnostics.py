# SPDX-License-Identifier: Apache-2.0
"""A field of diagnostics is published under its declared key."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import pytest

from objreg_ros.diagnostics import Diagnostics, by_key, family, reading


@dataclass(frozen=True, kw_only=True)
class Counts(Diagnostics):
    seen: int = reading("frames seen", "How many came.", "frames")
    median_ms: float | None = reading("median [ms]", "How long one took.", "ms", "{:.1f}", default=None)
    dropped: Mapping[str, int] = family("dropped: <reason>", "Those that did not go on.", "frames")
    sent: Mapping[tuple[str, str], int] = family("<robot>: frames <fate>", "What became of them.", "frames")
    moved: Mapping[str, float] = family("moved: <label>", "How far.", "m", "{:.2f} m")


def test_a_value_has_its_key_and_its_format() -> None:
    assert by_key(Counts(seen=3, median_ms=2.25)) == {"frames seen": 3, "median [ms]": "2.2"}


def test_what_is_not_known_is_left_out() -> None:
    assert by_key(Counts(seen=0)) == {"frames seen": 0}


def test_a_family_has_a_key_for_each_name_in_the_order_of_the_names() -> None:
    keys = by_key(Counts(seen=1, dropped={"late": 2, "bug <x>": 1}, moved={"cup": 0.456}))
    assert list(keys.items())[1:] == [("dropped: bug <x>", 1), ("dropped: late", 2), ("moved: cup", "0.46 m")]


def test_an_empty_name_leaves_out_its_colon() -> None:
    keys = by_key(Counts(seen=1, sent={("a/b", "kept"): 1, ("", "kept"): 2}))
    assert keys == {"frames seen": 1, "a/b: frames kept": 1, "frames kept": 2}


def test_a_name_too_few_is_refused() -> None:
    with pytest.raises(ValueError):
        by_key(Counts(seen=1, sent={"a": 1}))  # type: ignore[dict-item]


def test_several_parts_make_one_status() -> None:
    assert by_key(Counts(seen=1), Counts(seen=2, dropped={"late": 1})) == {"frames seen": 2, "dropped: late": 1}


def test_a_declaration_has_what_the_documentation_shows() -> None:
    seen, median, *_ = Counts.declarations()
    assert (seen.name, seen.key, seen.doc, seen.unit) == ("seen", "frames seen", "How many came.", "frames")
    assert median.form == "{:.1f}"
