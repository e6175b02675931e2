# SPDX-License-Identifier: Apache-2.0
"""Tests of recordings that are read as stills."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

MS = 1_000_000
PICTURES = np.arange(10) * 100 * MS


def records(offset_ms: int = 0) -> list[SimpleNamespace]:
    """Pictures and their depth, which is so many ms later, and odometry in between."""
    colour = [SimpleNamespace(topic="rgb", stamp_ns=int(t)) for t in PICTURES]
    depth = [SimpleNamespace(topic="depth", stamp_ns=int(t) + offset_ms * MS) for t in PICTURES]
    odom = [SimpleNamespace(topic="odom", stamp_ns=int(t) + 50 * MS) for t in PICTURES]
    return sorted([*colour, *depth, *odom], key=lambda record: record.stamp_ns)


@pytest.mark.parametrize("offset_ms", [0, 20, -20])
@pytest.mark.parametrize("every", [2, 3, 25])
def test_of_every_so_many_moments_one_is_left_with_all_that_belongs_to_it(every: int, offset_ms: int) -> None:
    from stills import thinned

    left = list(thinned(records(offset_ms), {"rgb", "depth"}, PICTURES, every))
    for topic, offset in (("rgb", 0), ("depth", offset_ms * MS)):
        assert [one.stamp_ns - offset for one in left if one.topic == topic] == list(PICTURES[::every])
    assert sum(one.topic == "odom" for one in left) == len(PICTURES)


def test_a_recording_without_pictures_has_no_stills() -> None:
    from stills import stills

    from objreg_tools.recording.inputs import Inputs

    recording = SimpleNamespace(records=lambda topics: iter(()))
    with pytest.raises(ValueError, match="expected a recording with pictures"):
        stills(recording, Inputs(odom="odom"), 2)


def test_depth_is_left_beside_colour_where_that_is_asked() -> None:
    from sources import Unturned

    image = SimpleNamespace()
    assert Unturned().register(image, 1.0) is image


def test_stills_of_a_kitchen_close_no_less_where_depth_is_brought_upon_colour(shared: Path) -> None:
    from frame_pairs import Truths, draw_pairs
    from pairs import Ours
    from sources import Reading, detector_of, read_source

    from objreg_ros.keyframes.frame_window import FrameWindow
    from objreg_ros.keyframes.fusion import fuse
    from objreg_ros.registrar.params import RegistrarParams

    params, accepted = RegistrarParams(), {}
    detector = detector_of(str(shared / "models/ssd_mobilenet_v1_coco_int8.onnx"), 0.4)
    for registered in (True, False):
        reading = Reading(every=12, registered=registered)
        with read_source(shared / "data/redkitchen_a", detector, 1, reading=reading) as source:
            stills = [fuse(FrameWindow.of(frame), params) for frame in source.frames]
            seen = [still for still in stills if still.objects and source.truth.at(still.stamp_ns) is not None]
            truths = Truths(seen, [source.truth.at(still.stamp_ns) for still in seen], params)
            ours, pairs = Ours(seen, params), draw_pairs(truths, len(seen), 30, 19)
        rows = [ours(pair) for pair in pairs]
        accepted[registered] = sum(row.accepted for row in rows)
        assert all(row.within((8.0, 15.0)) for row in rows if row.accepted)
    assert accepted[True] >= 20 and accepted[True] >= 0.9 * accepted[False]  # one pair of ten is chance
