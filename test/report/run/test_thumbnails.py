# SPDX-License-Identifier: Apache-2.0
"""The pictures of all pairs, each once, and no more than a page can carry."""

from __future__ import annotations

import numpy as np

from objreg_ros.data.images import DepthImage, Intrinsics
from objreg_tools.report.closures.matched_features import MOST
from objreg_tools.report.run.pairs import pairs_of
from objreg_tools.report.run.run_summary import RunSummary
from objreg_tools.report.run.thumbnails import thumbnails
from report.runs import STEP_NS, TRUTH, refusal, summary

CAMERA = Intrinsics(fx=40.0, fy=40.0, cx=32.0, cy=24.0, width=64, height=48)
RGB = np.random.default_rng(0).integers(0, 255, (48, 64, 3), np.uint8)
SEEN = DepthImage(depth=np.full((48, 64), 2.0, np.float32), intrinsics=CAMERA, stamp_ns=0, frame_id="camera", rgb=RGB)


class Wall:
    """An album in which every moment but those of the dark shows the same wall."""

    def __init__(self, dark_ns: int | None = None) -> None:
        self.dark_ns = dark_ns

    def lacking(self, stamp_ns: int) -> str:
        return "it was dark" if stamp_ns == self.dark_ns else ""

    def at(self, stamp_ns: int) -> DepthImage | None:
        return None if stamp_ns == self.dark_ns else SEEN


PAIRS = pairs_of(RunSummary.of("walk", summary(false=True), TRUTH))


def test_a_moment_of_two_pairs_is_kept_once_and_a_pose_has_its_overlay() -> None:
    run = {**summary(), "refusals": [refusal("texture_disagrees", 5, 99)]}  # 5 is a moment of the first closure too
    drawn = thumbnails(pairs_of(RunSummary.of("walk", run, TRUTH)), Wall())
    assert len(drawn.moments) == 9 and list(drawn.overlays) == ["c0", "c1", "c2", "c3"]
    assert all(uri.startswith("data:image/webp;base64,") for uri in (*drawn.moments.values(), *drawn.overlays.values()))
    assert drawn.left_out == 0 and not drawn.lacking


def test_a_pair_with_a_pose_has_the_features_that_it_brings_together() -> None:
    drawn = thumbnails(PAIRS, Wall())
    assert drawn.features.keys() == drawn.overlays.keys()
    assert all(one.ends.shape == (min(one.agreeing, MOST), 4) for one in drawn.features.values())


def test_what_has_no_picture_is_counted_by_why() -> None:
    drawn = thumbnails(PAIRS, Wall(dark_ns=10 * STEP_NS))
    assert drawn.lacking == {"it was dark": 1} and "c4" not in drawn.overlays


def test_a_page_that_is_full_says_how_many_pairs_it_leaves_out_and_keeps_the_false_one() -> None:
    whole = thumbnails(PAIRS, Wall())
    part = thumbnails(PAIRS, Wall(), whole.size // 2)
    assert part.size <= whole.size // 2 and "c4" in part.overlays
    assert part.left_out == len(PAIRS) - len(part.overlays) > 0
    assert thumbnails(PAIRS, None).moments == {}
