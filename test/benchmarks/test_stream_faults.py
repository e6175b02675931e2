# SPDX-License-Identifier: Apache-2.0
"""What each fault does to the messages of a right recording, and what it leaves alone."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from objreg_ros.bridge.messages import from_msg, headers
from objreg_ros.data.images import Intrinsics
from objreg_ros.geometry import inverse, pose, rotation_angle, rotation_from_vector
from objreg_tools.recording.inputs import choose_inputs
from objreg_tools.recording.mounts import frame_tree
from objreg_tools.recording.rosbag import messages

CAMERA = Intrinsics(fx=30.0, fy=31.0, cx=16.0, cy=12.0, width=32, height=24)
STEP_NS, COUNT = 100_000_000, 12
SEEDS = range(20)
T_BODY_CAMERA = pose(rotation_from_vector(np.array([1.2, -1.2, 1.2])), np.array([0.2, 0.03, 1.1]))


def right(encoding: str = "16UC1") -> Any:
    """A recording of twelve moments: a grey picture as bright as its number, depth of 1 m and more."""
    import stream_recording as names
    from stream_faults import static_transform

    at = [k * STEP_NS for k in range(COUNT)]
    info = [(ns, messages.camera_info(CAMERA, ns, names.CAMERA)) for ns in at]
    colour = [np.full((24, 32, 3), 10 * k, np.uint8) for k in range(COUNT)]
    for k, pixels in enumerate(colour):
        pixels[:, 0] = 200 + k
    dtype, metre = (np.uint16, 1000) if encoding == "16UC1" else (np.float32, 1)
    depth = [np.full((24, 32), (1 + k) * metre, dtype) for k in range(COUNT)]
    odom = [messages.odometry(walked(k), np.eye(6), ns, "odom", names.BODY) for k, ns in enumerate(at)]
    static = static_transform(T_BODY_CAMERA, 0, names.BODY, names.CAMERA)
    return names.MemoryRecording(
        Path("right"),
        {
            names.COLOUR_INFO: names.Stream.of(names.INFO_TYPE, info),
            names.DEPTH_INFO: names.Stream.of(names.INFO_TYPE, info),
            names.COLOUR: pictures(at, colour, "rgb8"),
            names.DEPTH: pictures(at, depth, encoding),
            names.TF_STATIC: names.Stream.of(names.TF_TYPE, [(0, static)]),
            names.ODOM: names.Stream.of(names.ODOM_TYPE, list(zip(at, odom, strict=True))),
        },
    )


def pictures(at: list[int], pixels: list[np.ndarray], encoding: str) -> Any:
    import stream_recording as names

    made = [(ns, messages.image(p, encoding, ns, names.CAMERA)) for ns, p in zip(at, pixels, strict=True)]
    return names.Stream.of(names.IMAGE_TYPE, made)


def walked(k: int) -> np.ndarray:
    return pose(rotation_from_vector(np.array([0.0, 0.0, 0.1 * k])), np.array([0.2 * k, 0.0, 0.0]))


def made(kind: str, seed: int = 0, is_level: bool = False, encoding: str = "16UC1") -> Any:
    from stream_faults import KINDS, Aside

    others = np.array([pose(np.eye(3), np.array([0.0, float(k), 0.0])) for k in range(5)])
    aside = Aside(T_BODY_CAMERA, is_level, others)
    return KINDS[kind].make(right(encoding), np.random.default_rng(seed), aside)


def cameras(recording: Any, topic: str) -> tuple[np.ndarray, np.ndarray]:
    infos = recording.messages(topic)
    assert all(np.array_equal(info.k, infos[0].k) and np.array_equal(info.p, infos[0].p) for info in infos)
    return infos[0].k.reshape(3, 3), infos[0].p.reshape(3, 4)


def changed(recording: Any) -> set[str]:
    """The topics whose bytes are not those of the right recording, or that are new or gone."""
    before, after = (
        {name: [record.cdr for record in of.records([name])] for name in of.topics} for of in (right(), recording)
    )
    return {name for name in before.keys() | after.keys() if before.get(name) != after.get(name)}


def test_a_right_recording_is_passed_on_to_the_bit() -> None:
    assert changed(made("right").recording) == set()


def test_a_fault_is_that_of_its_seed_and_leaves_the_right_recording_alone() -> None:
    from stream_faults import KINDS, Aside

    recording, aside = right(), Aside(T_BODY_CAMERA, False, np.array([np.eye(4)] * 3))
    for name, kind in KINDS.items():
        made_of = [kind.make(recording, np.random.default_rng(seed), aside) for seed in (1, 1, *SEEDS)]
        assert made_of[0].magnitude == made_of[1].magnitude, name
        various = {str(fault.magnitude) for fault in made_of}
        assert len(various) > 1 or name in ("right", "two_cameras"), name
        assert all(record.cdr for record in made_of[0].recording.records())
    assert changed(recording) == set()


def test_every_kind_but_the_right_one_has_a_cause_and_changes_something() -> None:
    from stream_faults import KINDS, RIGHT

    for name, kind in KINDS.items():
        assert bool(kind.anchors) == bool(changed(made(name).recording)) == (name != RIGHT), name


def test_focal_lengths_are_2_to_60_percent_off_in_both_matrices_and_both_cameras() -> None:
    from stream_recording import COLOUR_INFO, DEPTH_INFO

    factors = []
    for seed in SEEDS:
        fault = made("focal", seed)
        factors.append(fault.magnitude["factor"])
        for topic in (COLOUR_INFO, DEPTH_INFO):
            K, P = cameras(fault.recording, topic)
            assert np.allclose([K[0, 0], K[1, 1], P[0, 0], P[1, 1]], np.array([30, 31, 30, 31]) * factors[-1])
            assert np.allclose([K[0, 2], K[1, 2], P[0, 2], P[1, 2]], [16, 12, 16, 12])
    off = np.abs(np.array(factors) - 1)
    assert (off >= 0.02).all() and (off <= 0.6).all() and min(factors) < 1 < max(factors)
    assert changed(fault.recording) == {COLOUR_INFO, DEPTH_INFO}


def test_the_depth_cameras_info_leaves_that_of_colour_as_it_is() -> None:
    from stream_recording import DEPTH_INFO

    fault = made("depth_camera")
    K, _ = cameras(fault.recording, DEPTH_INFO)
    assert K[0, 0] / 30 == pytest.approx(fault.magnitude["factor"]) and 0.6 <= fault.magnitude["factor"] <= 0.9
    assert changed(fault.recording) == {DEPTH_INFO}
    assert choose_inputs(fault.recording.topics).camera_info == DEPTH_INFO


def test_a_stale_projection_is_of_twice_or_half_the_size_beside_a_right_K() -> None:
    from stream_recording import DEPTH_INFO

    seen = set()
    for seed in SEEDS:
        K, P = cameras(made("stale_projection", seed).recording, DEPTH_INFO)
        assert np.allclose(K, [[30, 0, 16], [0, 31, 12], [0, 0, 1]])
        assert np.allclose(P[:2, :3], K[:2] * P[0, 0] / 30) and P[2, 2] == 1
        seen.add(P[0, 0] / 30)
    assert seen == {0.5, 2.0}


def test_a_default_projection_has_its_middle_in_that_of_half_the_size() -> None:
    from stream_recording import COLOUR_INFO

    fault = made("default_projection")
    K, P = cameras(fault.recording, COLOUR_INFO)
    assert (P[0, 2], P[1, 2]) == (8, 6) and K[0, 2] == 16
    assert 2 * np.degrees(np.arctan(8 / P[0, 0])) == pytest.approx(fault.magnitude["wide_deg"])


@pytest.mark.parametrize(("kind", "least", "most"), [("middle_outside", 0.4, 1.0), ("middle_aside", 0.05, 0.25)])
def test_the_principal_point_is_moved_by_a_share_of_the_picture(kind: str, least: float, most: float) -> None:
    from stream_recording import DEPTH_INFO

    for seed in SEEDS:
        K, P = cameras(made(kind, seed).recording, DEPTH_INFO)
        moved = K[:2, 2] - [16, 12]
        share = np.linalg.norm(moved / [32, 24] if kind == "middle_outside" else moved / 32)
        assert least <= share <= most and np.allclose(K[:2, 2], P[:2, 2]) and K[0, 0] == 30


def test_depth_is_scaled_and_what_16_bits_do_not_hold_is_not_measured() -> None:
    from stream_faults import scaled_depth

    millimetres = np.array([[0, 1000, 30000, 65535]], np.uint16)
    message = messages.image(millimetres, "16UC1", 5, "camera")
    assert scaled_depth(message, 2.0).data.view(np.uint16).tolist() == [0, 2000, 60000, 0]
    assert message.data.view(np.uint16).tolist() == millimetres.ravel().tolist()
    metres = messages.image(np.array([[0.0, 2.0, np.nan]], np.float32), "32FC1", 5, "camera")
    assert np.array_equal(scaled_depth(metres, 0.5).data.view(np.float32), [0, 1, np.nan], equal_nan=True)


@pytest.mark.parametrize("encoding", ["16UC1", "32FC1"])
def test_the_scale_of_depth_is_never_nearly_right(encoding: str) -> None:
    from stream_recording import DEPTH

    for seed in SEEDS:
        fault = made("depth_scale", seed, encoding=encoding)
        factor = fault.magnitude["factor"]
        depth = from_msg.depth(fault.recording.messages(DEPTH)[2])
        assert 0.3 <= factor <= 3.0 and abs(factor - 1) >= 0.05 and np.allclose(depth, 3 * factor, atol=6e-4)


def test_another_camera_shows_other_parts_mirrored_at_the_same_times_under_either_name() -> None:
    from stream_faults import FRONT_COLOUR, FRONT_INFO
    from stream_recording import COLOUR, DEPTH

    seen = set()
    for seed in SEEDS:
        recording = made("other_colour", seed).recording
        inputs = choose_inputs(recording.topics)
        seen.add(str(inputs.image))
        colour = recording.messages(str(inputs.image))
        assert [headers.stamp_ns(m) for m in colour] == [headers.stamp_ns(m) for m in recording.messages(DEPTH)]
        numbers = [int(from_msg.image(m).rgb[0, -1, 0]) - 200 for m in colour]
        assert numbers == [(7 * k + 6) % COUNT for k in range(COUNT)]
    assert seen == {COLOUR, FRONT_COLOUR}
    assert changed(made("two_cameras").recording) == {FRONT_COLOUR, FRONT_INFO}


def test_one_stream_of_pictures_is_stamped_30_to_300_ms_off() -> None:
    from stream_recording import COLOUR, DEPTH

    for seed in SEEDS:
        fault = made("late_pictures", seed)
        (topic,) = changed(fault.recording)
        off = [headers.stamp_ns(m) - k * STEP_NS for k, m in enumerate(fault.recording.messages(topic))]
        assert topic in (COLOUR, DEPTH) and set(off) == {round(fault.magnitude["ms"] * 1e6)}
        assert 30e6 <= abs(off[0]) <= 300e6


def test_odometry_of_another_robot_keeps_its_stamps_and_leads_elsewhere() -> None:
    from stream_faults import odometry_poses
    from stream_recording import ODOM

    own, seen = odometry_poses(right()), set()
    for seed in SEEDS:
        fault = made("other_robot", seed)
        poses = odometry_poses(fault.recording)
        seen.add(fault.magnitude["how"])
        stamps = [headers.stamp_ns(m) for m in fault.recording.messages(ODOM)]
        assert stamps == [k * STEP_NS for k in range(COUNT)] and changed(fault.recording) == {ODOM}
        if fault.magnitude["how"] == "other":
            assert np.allclose(poses[-1] @ T_BODY_CAMERA, pose(np.eye(3), np.array([0.0, 4.0, 0.0])))
        else:
            assert np.allclose(poses, own[::-1])
    assert seen == {"other", "backwards"}


def test_another_clock_moves_all_stamps_of_odometry_alike() -> None:
    from stream_recording import ODOM

    for seed in SEEDS:
        recording = made("odometry_clock", seed).recording
        off = {headers.stamp_ns(m) - k * STEP_NS for k, m in enumerate(recording.messages(ODOM))}
        assert len(off) == 1 and 0.3e9 <= abs(off.pop()) <= 50e9


def test_odometry_with_gaps_is_its_beginning_or_its_end() -> None:
    from stream_recording import ODOM

    whole = [record.cdr for record in right().records([ODOM])]
    for seed in SEEDS:
        fault = made("odometry_gaps", seed)
        part = [record.cdr for record in fault.recording.records([ODOM])]
        count = max(2, round(fault.magnitude["share"] * COUNT))
        assert part == (whole[:count] if fault.magnitude["stops_early"] else whole[-count:])


@pytest.mark.parametrize("is_level", [False, True])
def test_an_unknown_mount_moves_the_camera_as_before_and_says_nothing_of_itself(is_level: bool) -> None:
    from stream_faults import odometry_poses
    from stream_recording import ODOM, TF_STATIC

    own = odometry_poses(right()) @ T_BODY_CAMERA
    for seed in SEEDS:
        fault = made("mount_unknown", seed, is_level)
        bodies = odometry_poses(fault.recording)
        assert changed(fault.recording) == {ODOM, TF_STATIC} and TF_STATIC not in fault.recording.topics
        assert np.allclose(bodies @ fault.T_body_camera, own)
        assert not np.allclose(bodies, odometry_poses(right()))
        turns = (inverse(bodies[0]) @ bodies[-1])[:3, :3]
        assert not is_level or np.allclose(turns[2], [0, 0, 1])


def test_a_wrong_mount_is_turned_by_20_to_180_degrees_at_the_same_place() -> None:
    from stream_recording import BODY, CAMERA, TF_STATIC

    for seed in SEEDS:
        fault = made("mount_wrong", seed)
        T = frame_tree(fault.recording).between(BODY, CAMERA)
        assert T is not None and changed(fault.recording) == {TF_STATIC}
        turned = np.degrees(rotation_angle(T_BODY_CAMERA[:3, :3].T @ T[:3, :3]))
        assert turned == pytest.approx(fault.magnitude["degrees"], abs=1e-6) and 20 <= turned <= 180
        assert np.allclose(T[:3, 3], T_BODY_CAMERA[:3, 3])


def test_records_are_in_order_of_time_and_within_the_asked_time() -> None:
    from stream_recording import COLOUR, DEPTH

    records = list(right().records([COLOUR, DEPTH], 2 * STEP_NS, 4 * STEP_NS))
    assert [(r.topic, r.stamp_ns // STEP_NS) for r in records] == [(COLOUR, 2), (DEPTH, 2), (COLOUR, 3), (DEPTH, 3)]
    assert right().without(DEPTH).topics.keys() == right().topics.keys() - {DEPTH}
