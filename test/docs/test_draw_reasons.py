# SPDX-License-Identifier: Apache-2.0
"""The reference of reasons in the documents is that of the code, with pictures that are there and small."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from docs.draw_reasons import PAGE, PICTURES, SCHEMES, SYMPTOM, common, details, section, side_by_side, with_reference
from docs.schemes import DROPS as DROP_SCHEMES
from objreg_ros.data.closures import Reason
from objreg_ros.data.images import DepthImage, Intrinsics
from objreg_tools.report.run.reasons import DROPS, REFUSALS, ReasonText

MOST_BYTES, MOST_OF_ALL = 60_000, 1_000_000
CAMERA = Intrinsics(fx=300.0, fy=300.0, cx=159.5, cy=119.5, width=320, height=240)


class Wall:
    """An album of one grey wall at 2 m, at every moment but 0."""

    def at(self, stamp_ns: int) -> DepthImage | None:
        rgb = np.full((240, 320, 3), 120, np.uint8)
        depth = np.full((240, 320), 2.0, np.float32)
        return DepthImage(depth=depth, rgb=rgb, intrinsics=CAMERA, stamp_ns=stamp_ns) if stamp_ns else None


def test_the_reference_in_the_page_is_made_of_the_texts_of_now() -> None:
    page = PAGE.read_text(encoding="utf-8")
    assert with_reference(page, details()) == page, "run python -m docs.draw_reasons"


def test_every_reason_has_a_row_that_leads_to_its_section() -> None:
    page = PAGE.read_text(encoding="utf-8")
    rows = dict(re.findall(r"^\| \[`(\w+)`\]\(#(\w+)\) \|", page, re.MULTILINE))
    assert set(rows) == {reason.value for reason in Reason} | set(DROPS)
    headings = set(re.findall(r"^### `(\w+)`$", page, re.MULTILINE)) | {SYMPTOM}
    assert set(rows.values()) == set(rows) == headings


def test_the_pictures_are_those_of_now_and_small() -> None:
    for name, svg in {**SCHEMES, **DROP_SCHEMES}.items():
        assert (PICTURES / f"{name}.svg").read_text(encoding="utf-8") == svg, "run python -m docs.draw_reasons"
    sizes = [path.stat().st_size for path in PICTURES.iterdir()]
    assert max(sizes) <= MOST_BYTES and sum(sizes) <= MOST_OF_ALL
    assert {path.stem for path in PICTURES.glob("*.jpg")} == set(details()) <= set(REFUSALS)


def test_a_pair_without_a_pose_or_without_a_picture_is_not_drawn() -> None:
    row = {"from_ns": 1, "to_ns": 2, "T_from_to": np.eye(4).tolist()}
    rgb = side_by_side(row, Wall())  # type: ignore[arg-type]
    assert rgb is not None and rgb.shape[1] == 3 * (320 * 2 // 3) and common(rgb) > 0.9 * rgb.size / 9
    assert side_by_side({**row, "from_ns": 0}, Wall()) is None  # type: ignore[arg-type]
    assert side_by_side({**row, "T_from_to": None}, Wall()) is None  # type: ignore[arg-type]


def test_a_section_names_what_stands_behind_a_reason() -> None:
    written = section(
        "late", ReasonText("it came late", "Wait.", ("segmenter.slop",), (("data/frames.py", "JUMP_NS"),)), "", "1 > 0"
    )
    assert (
        "It came late. Wait. Behind it: [`segmenter.slop`](parameters.md#segmenter), `JUMP_NS` in `data/frames.py`."
        in written
    )
    assert "![A pair refused as late](pictures/late.jpg)" in written and "*1 > 0*" in written


def test_a_page_without_a_place_for_the_reference_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="expected <!-- made"):
        with_reference("# nothing\n", {})
