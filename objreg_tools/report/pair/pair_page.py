# SPDX-License-Identifier: Apache-2.0
"""The page of one pair: its pictures, what was matched between them, and why the answer is yes or no."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import cv2
import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.images import DepthImage, Detections, Intrinsics
from objreg_ros.registration.candidate import Candidate
from objreg_ros.registration.keyframe import Keyframe
from objreg_ros.registration.prepare.keypoints import KeypointMatches
from objreg_ros.registration.score.keypoint_agreement import agreeing
from objreg_tools.report.closures.matched_features import counted, ends_of, lines_as_svg, spread
from objreg_tools.report.closures.matched_objects import Match, height, marks_of, seen_object
from objreg_tools.report.closures.weighed_evidence import EVIDENCE, with_unit
from objreg_tools.report.live_pictures import sight
from objreg_tools.report.page import environment
from objreg_tools.report.pair.registered_pair import RegisteredPair
from objreg_tools.report.run.pictures import WIDTH, data_uri, overlay
from objreg_tools.report.run.reasons import MEANINGS
from objreg_tools.report.words import reading


class Seen(NamedTuple):
    """The picture of a frame with its depth, and what was detected in it, None where that is not known."""

    image: DepthImage
    detections: Detections | None


def pair_page(name: str, summary: Mapping[str, Any], found: RegisteredPair, seen: Sequence[Seen | None]) -> str:
    """The HTML of a pair of the recording ``name``; a frame without a picture is left out of the drawings."""
    first, second = seen
    pictures = [
        (_picture(one, keyframe), f"{letter}, {(keyframe.stamp_ns - summary['start_ns']) * 1e-9:.3f} s")
        for letter, one, keyframe in zip("AB", seen, (found.first, found.second), strict=True)
        if one is not None
    ]
    matches = None
    if first is not None and second is not None and found.candidate is not None:
        laid = overlay(first.image, second.image, found.candidate.T_target_source)
        pictures.append((data_uri(laid), "B laid over A by the best pose: grey is agreement"))
    if first is not None and second is not None:
        matches = _matches(first.image, second.image, found)
    meaning = "" if summary["accepted"] else MEANINGS.get(summary["reason"], "")
    template = environment().get_template("pair.html.j2")
    return template.render(
        name=name, pair=summary, pictures=pictures, matches=matches, meaning=meaning,
        evidence=EVIDENCE, with_unit=with_unit, reading=reading,
    )  # fmt: skip


def _picture(seen: Seen, keyframe: Keyframe) -> str:
    """The picture with its boxes and the points of its objects, drawn at the size at which it is shown."""
    image, found = seen.image, seen.detections
    assert image.rgb is not None  # an album gives no picture without colour
    step = max(1, image.intrinsics.width // WIDTH)
    camera = image.intrinsics.scaled(step)
    size = camera.width, camera.height
    small = cv2.resize(np.ascontiguousarray(image.rgb), size, interpolation=cv2.INTER_AREA)
    boxes = Detections(
        xyxy=np.zeros((0, 4), np.float32) if found is None else found.xyxy / np.float32(step),
        score=np.zeros(0, np.float32) if found is None else found.score,
        label=() if found is None else found.label,
        image_hw=small.shape[:2],
        stamp_ns=image.stamp_ns,
    )
    return data_uri(sight(small, camera, boxes, [item.cloud for item in keyframe.objects]))


def _matches(first: DepthImage, second: DepthImage, found: RegisteredPair) -> dict[str, Any]:
    """Both pictures and, as SVG over them, the objects and the keypoints that were matched."""
    assert first.rgb is not None and second.rgb is not None  # an album gives no picture without colour
    cameras = first.intrinsics, second.intrinsics
    return {
        "pictures": [data_uri(first.rgb), data_uri(second.rgb)],
        "height": max(map(height, cameras)),
        "objects": _objects(found, cameras),
        "lines": [] if found.matches is None else _lines(found.matches, cameras, found.candidate),
    }


def _lines(
    matches: KeypointMatches, cameras: tuple[Intrinsics, Intrinsics], best: Candidate | None
) -> list[dict[str, Any]]:
    """The matched keypoints by whether they agree with the pose, each kind with its switch; of one kind without one."""
    ends = ends_of(matches, cameras)
    if best is None:
        return [_kind("disagree", "features", f"{len(ends)} features match; there is no pose", ends, is_on=True)]
    agree = agreeing(matches, best.T_target_source)
    chosen = {verb: ends[of_kind] for verb, of_kind in (("agree", agree), ("disagree", ~agree))}
    counts = {verb: counted(len(some), len(ends), verb) for verb, some in chosen.items()}
    return [
        _kind("agree", "features", counts["agree"], chosen["agree"], is_on=True),
        _kind("disagree", "those that disagree", counts["disagree"], chosen["disagree"], is_on=False),
    ]


def _kind(style: str, label: str, text: str, ends: Array, is_on: bool) -> dict[str, Any]:
    return {"style": style, "label": label, "text": text, "svg": lines_as_svg(ends[spread(ends)]), "is_on": is_on}


def _objects(found: RegisteredPair, cameras: tuple[Intrinsics, Intrinsics]) -> str:
    """The objects of both frames as SVG, those that the pose lays on each other in a colour each."""
    first, second = (
        [seen_object(item.label, item.cloud.xyz, camera) for item in keyframe.objects]
        for keyframe, camera in zip((found.first, found.second), cameras, strict=True)
    )
    pairs = () if found.candidate is None else found.candidate.matched
    matches = [Match(pair.label, first[pair.target], second[pair.source]) for pair in pairs]
    return marks_of((first, second), matches, cameras, None)
