# SPDX-License-Identifier: Apache-2.0
"""The truth beside a recording: what is written comes back, and what is no truth is refused."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest

from objreg_ros.data.images import Intrinsics
from objreg_ros.geometry import inverse, pose, rotation_from_vector
from objreg_tools.simulation.rendering.render import Rendering, SeenPixels
from objreg_tools.simulation.scenarios import RecordingPlan
from objreg_tools.simulation.truth import FOLDER, FRAMES, MASKS, SimulationTruth, TruthWriter, read_truth
from objreg_tools.simulation.world.mesh import Material, box
from objreg_tools.simulation.world.model import ObjectModel, Symmetry, half_turns, revolution
from objreg_tools.simulation.world.scene import Placed, Scene

CAMERA = Intrinsics(fx=13.125, fy=13.25, cx=7.5, cy=5.25, width=16, height=12)
CENTRE = np.array([0.0, 0.0, 0.15])
KINDS = {"book": half_turns(CENTRE), "soda_can": revolution("z", CENTRE), "mug": Symmetry()}
SIZE = (0.1, 0.2, 0.3)
STAMPS = (1_700_000_000_123_456_789, 1_700_000_000_200_000_000)


def placed(instance: int, label: str, x: float) -> Placed:
    model = ObjectModel(label, box(SIZE, Material(np.zeros((2, 2, 3), np.uint8))), KINDS[label])
    return Placed(instance, model, pose(rotation_from_vector(np.array([0.1, 0.2, x])), np.array([x, 2.0, 0.7])))


def scene(*objects: Placed) -> Scene:
    return Scene(objects, (), (), np.full(3, 0.5))


BEFORE = scene(*(placed(k, label, 0.1 * k) for k, label in enumerate(KINDS, start=1)))
AFTER = scene(placed(1, "book", 3.0))
PLAN = RecordingPlan((BEFORE, AFTER), np.array([0, 1]), np.tile(np.eye(4), (2, 1, 1)), 30.0)
T_WORLD_CAMERA = pose(rotation_from_vector(np.array([0.4, -1.0, 0.3])), np.array([1.0, 2.0, 3.0]))


def rendering(*seen: Placed) -> Rendering:
    """An image in which every object covers two pixels of a row of its own; what it looks like does not matter."""
    instance = np.zeros((12, 16), np.uint16)
    sights = []
    for row, o in enumerate(seen):
        instance[row, 3:5] = o.instance
        T = inverse(T_WORLD_CAMERA) @ o.T_world_object
        xyxy = np.array([3, row, 5, row + 1], np.float32)
        sights.append(
            SeenPixels(o.instance, o.label, o.is_distractor, xyxy, 2, 0.123456, o.T_world_object, T, o.model.symmetry)
        )
    nothing = np.zeros((12, 16), np.float32)
    return Rendering(nothing, nothing, None, instance, tuple(sights), T_WORLD_CAMERA, CAMERA)


def written(recording: Path, plan: RecordingPlan = PLAN, *images: Rendering) -> SimulationTruth:
    """The truth of a plan, written and read again; by default of two frames, with the book in both."""
    writer = TruthWriter(plan, "loop", 7, CAMERA)
    for k, image in enumerate(images or (rendering(*BEFORE.objects[:2]), rendering(*AFTER.objects))):
        writer.write_frame(STAMPS[k], int(plan.scene_of[k]), image)
    recording.mkdir(exist_ok=True)
    writer.write(recording)
    return read_truth(recording)


def test_the_head_comes_back_as_it_was(tmp_path: Path) -> None:
    truth = written(tmp_path)
    assert (truth.scenario, truth.seed, truth.rate) == ("loop", 7, 30.0)
    assert asdict(truth.intrinsics) == asdict(CAMERA)
    head = json.loads((tmp_path / FOLDER / FRAMES).read_text().splitlines()[0])
    assert head["frames"] == 2 and head["labels"][0] == "cap"


def test_every_object_comes_back_with_its_place_and_its_symmetry(tmp_path: Path) -> None:
    first, second = written(tmp_path).objects
    assert list(first) == [1, 2, 3] and list(second) == [1]
    for o in BEFORE.objects:
        back = first[o.instance]
        assert (back.instance, back.label, back.is_distractor) == (o.instance, o.label, o.label == "mug")
        assert np.array_equal(back.T_world_object, o.T_world_object) and back.size == pytest.approx(SIZE)
        for name in ("axis", "centre", "turns"):
            was, now = (getattr(symmetry, name) for symmetry in (o.model.symmetry, back.symmetry))
            assert (was is None and now is None) or np.array_equal(was, now)
    assert second[1].T_world_object[0, 3] == 3.0


def test_every_frame_comes_back_with_what_it_shows(tmp_path: Path) -> None:
    truth = written(tmp_path)
    assert [(frame.stamp_ns, frame.scene) for frame in truth.frames] == [(STAMPS[0], 0), (STAMPS[1], 1)]
    frame = truth.frames[0]
    assert np.array_equal(frame.T_world_camera, T_WORLD_CAMERA)
    assert [sight.object for sight in frame.seen] == [truth.objects[0][1], truth.objects[0][2]]
    can = frame.seen[1]
    assert can.xyxy.dtype == np.float32 and can.xyxy.tolist() == [3, 1, 5, 2]
    assert (can.visibility, can.pixels) == (0.1235, 2)


def test_an_object_is_in_the_camera_where_its_own_scene_puts_it(tmp_path: Path) -> None:
    before, after = (frame.seen[0] for frame in written(tmp_path).frames)
    for sight, o in ((before, BEFORE.objects[0]), (after, AFTER.objects[0])):
        np.testing.assert_allclose(T_WORLD_CAMERA @ sight.T_camera_object, o.T_world_object, atol=1e-12)


def test_a_frame_is_found_by_its_exact_time_only(tmp_path: Path) -> None:
    truth = written(tmp_path)
    assert truth.frame(STAMPS[1]) is truth.frames[1]
    assert truth.frame(STAMPS[1] + 1) is None and truth.frame(STAMPS[1] - 1) is None


def test_a_mask_holds_the_number_of_the_object_of_every_pixel(tmp_path: Path) -> None:
    mask = written(tmp_path).mask(STAMPS[0])
    assert mask.dtype == np.uint16 and np.array_equal(mask, rendering(*BEFORE.objects[:2]).instance)


def test_more_objects_than_a_byte_counts_keep_their_numbers_in_the_mask(tmp_path: Path) -> None:
    many = scene(placed(1, "book", 0.0), placed(300, "mug", 1.0))
    plan = RecordingPlan((scene(), many), np.array([1]), np.eye(4)[None], 30.0)
    mask = written(tmp_path, plan, rendering(*many.objects)).mask(STAMPS[0])
    assert sorted(np.unique(mask)) == [0, 1, 300]


def test_the_mask_of_a_frame_that_there_is_not_is_a_key_error(tmp_path: Path) -> None:
    with pytest.raises(KeyError, match=r"5\.png"):
        written(tmp_path).mask(5)


def test_an_empty_scene_has_a_truth_too(tmp_path: Path) -> None:
    truth = written(tmp_path, RecordingPlan((scene(),), np.array([0]), np.eye(4)[None], 30.0), rendering())
    assert truth.objects == ({},) and truth.frames[0].seen == () and not truth.mask(STAMPS[0]).any()


def test_the_same_plan_gives_the_same_bytes(tmp_path: Path) -> None:
    folders = [written(tmp_path / name).folder for name in ("a", "b")]
    for name in (FRAMES, MASKS):
        first, second = ((folder / name).read_bytes() for folder in folders)
        assert first == second
    assert first[10:14] == bytes((0, 0, 0x21, 0))  # 1980-01-01 00:00:00 as MS-DOS writes it


def test_a_recording_without_truth_says_where_it_comes_from(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="objreg simulate"):
        read_truth(tmp_path)


@pytest.mark.parametrize(
    ("text", "got"),
    [("", "None"), ("{}\n", "None"), ('{"format": "objreg-truth/9"}', "objreg-truth/9"), ("[]", r"\[\]")],
)
def test_another_format_is_refused_with_what_was_expected(text: str, got: str, tmp_path: Path) -> None:
    (tmp_path / FOLDER).mkdir()
    (tmp_path / FOLDER / FRAMES).write_text(text)
    with pytest.raises(
        ValueError, match=f"expected format objreg-truth/1, got '?{got}'?; simulate the recording again"
    ):
        read_truth(tmp_path)
