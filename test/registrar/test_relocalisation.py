# SPDX-License-Identifier: Apache-2.0
"""A later pass of a corridor in the map of an earlier one, by closures that are right or not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from registration.samples import SECOND, keyframe, moved

from objreg_ros.data.checked import Array
from objreg_ros.data.closures import LoopClosure
from objreg_ros.data.frames import Frame
from objreg_ros.geometry import inverse, pose_error, rotation_from_vector
from objreg_ros.keyframes.keyframer import SILENCE_S
from objreg_ros.registrar.relocalisation import ALONE_ODDS, Relocalisation, drift, fused
from objreg_ros.registration.keyframe import Keyframe

T_MAP_ODOM = moved(2.0, -1.0, 0.0)
T_MAP_ODOM[:3, :3] = rotation_from_vector(np.array([0.0, 0.0, 0.7]))
ASIDE = moved(0.4, 0.0, 0.0)
TIGHT = np.diag([0.01**2] * 3 + [0.005**2] * 3)
EARLIER, NOW = 3, 5


def place(session: int, seconds: float, T_odom_camera: Array, metres: float) -> Keyframe:
    made = keyframe(round(seconds), seconds, (), session)
    return replace(made, T_odom_camera=T_odom_camera, travelled=metres, by_odometry=True)


def frame(seconds: float, T_odom_camera: Array | None) -> Frame:
    view = keyframe(0, 0.0, ()).view
    return Frame(
        objects=(),
        support=None,
        view=view,
        gravity=None,
        gravity_confidence=0.0,
        T_odom_camera=T_odom_camera,
        stamp_ns=round(seconds * SECOND),
    )


class Pass:
    """The later pass: it goes along x, and closes with the earlier one where it is asked to."""

    def __init__(self) -> None:
        self.relocalisation = Relocalisation()

    def go(self, metres: float, session: int = NOW, seconds: float | None = None) -> None:
        self.relocalisation.note_frame(frame(100.0 + metres if seconds is None else seconds, moved(metres)), session)

    def close(self, metres: float, odds: float = 100.0, wrong: Array | None = None, earlier: int = EARLIER) -> None:
        self.go(metres)
        source = place(NOW, 100.0 + metres, moved(metres), metres)
        target = place(earlier, 10.0 + metres, T_MAP_ODOM @ moved(metres + 0.2), metres)
        T_target_source = moved(-0.2) @ (np.eye(4) if wrong is None else wrong)
        self.relocalisation.add_closure(closure(source, target, T_target_source, odds), source, target)


def closure(source: Keyframe, target: Keyframe, T: Array, odds: float) -> LoopClosure:
    return LoopClosure(
        from_ns=target.stamp_ns,
        to_ns=source.stamp_ns,
        T_from_to=T,
        covariance=TIGHT,
        labels=(),
        evidence={"odds": odds},
        from_session=target.session,
        to_session=source.session,
    )


@pytest.fixture
def walk() -> Pass:
    return Pass()


def test_one_closure_is_not_enough_and_the_reason_counts_it(walk: Pass) -> None:
    assert "no closure" in walk.relocalisation.reason
    walk.close(0.0)
    assert walk.relocalisation.relocalised is None
    assert f"1 to session {EARLIER}; expected two that agree" in walk.relocalisation.reason


def test_two_that_agree_show_where_the_camera_is_and_odometry_goes_on(walk: Pass) -> None:
    walk.close(0.0)
    walk.close(0.4)
    first = walk.relocalisation.relocalised
    walk.go(1.4)
    found = walk.relocalisation.relocalised
    assert first is not None and found is not None
    assert found.session == EARLIER and found.closures == 2 and found.target_ns == round(10.4 * SECOND)
    assert found.stamp_ns == round(101.4 * SECOND)
    assert np.allclose(found.T_map_odom, T_MAP_ODOM, atol=1e-9)
    assert np.allclose(found.T_map_camera, T_MAP_ODOM @ moved(1.4), atol=1e-9)
    assert np.all(np.diag(found.covariance) > np.diag(first.covariance))


def test_one_that_is_very_likely_or_that_others_confirmed_is_enough(walk: Pass) -> None:
    walk.close(0.0, odds=ALONE_ODDS)
    assert walk.relocalisation.relocalised is not None
    other = Pass()
    other.go(0.0)
    source, target = place(NOW, 100.0, np.eye(4), 0.0), place(EARLIER, 10.0, np.eye(4), 0.0)
    one = closure(source, target, np.eye(4), 10.0)
    other.relocalisation.add_closure(replace(one, evidence={"odds": 10.0, "agreeing": 3.0}), source, target)
    assert other.relocalisation.relocalised is not None


def test_two_that_disagree_show_nothing_and_two_more_on_one_side_do(walk: Pass) -> None:
    walk.close(0.0, wrong=ASIDE)
    walk.close(0.2, odds=ALONE_ODDS)
    assert walk.relocalisation.relocalised is None
    walk.close(0.4)
    assert walk.relocalisation.relocalised is None
    walk.close(0.6)
    found = walk.relocalisation.relocalised
    assert found is not None and np.allclose(found.T_map_odom, T_MAP_ODOM, atol=1e-9)


def test_a_wrong_one_later_moves_nothing(walk: Pass) -> None:
    walk.close(0.0)
    walk.close(0.2)
    walk.close(0.4, wrong=ASIDE)
    found = walk.relocalisation.relocalised
    assert found is not None and np.allclose(found.T_map_odom, T_MAP_ODOM, atol=1e-9)


def test_two_of_one_keyframe_do_not_confirm_each_other(walk: Pass) -> None:
    walk.close(0.0)
    walk.close(0.0)
    assert walk.relocalisation.relocalised is None


def test_closures_of_two_earlier_sessions_do_not_confirm_each_other(walk: Pass) -> None:
    walk.close(0.0)
    walk.close(0.2, earlier=EARLIER - 1)
    assert walk.relocalisation.relocalised is None
    assert f"1 to session {EARLIER - 1}, 1 to session {EARLIER}" in walk.relocalisation.reason


def test_a_closure_within_a_session_says_nothing(walk: Pass) -> None:
    walk.close(0.0, odds=ALONE_ODDS, earlier=NOW)
    assert walk.relocalisation.relocalised is None and "no closure" in walk.relocalisation.reason


def test_another_session_and_a_silence_forget(walk: Pass) -> None:
    walk.close(0.0, odds=ALONE_ODDS)
    walk.go(0.2)
    walk.go(0.2, seconds=99.0)  # late
    assert walk.relocalisation.relocalised is not None
    walk.go(0.2, seconds=100.3 + SILENCE_S)
    assert walk.relocalisation.relocalised is None
    walk.close(SILENCE_S + 1.0, odds=ALONE_ODDS)
    assert walk.relocalisation.relocalised is not None
    walk.go(SILENCE_S + 1.1, session=NOW + 1)
    assert walk.relocalisation.relocalised is None


def test_a_search_that_ends_after_a_silence_is_of_odometry_that_is_over(walk: Pass) -> None:
    walk.go(0.0)
    walk.go(0.0, seconds=101.0 + SILENCE_S)
    source, target = place(NOW, 100.0, np.eye(4), 0.0), place(EARLIER, 10.0, np.eye(4), 0.0)
    walk.relocalisation.add_closure(closure(source, target, np.eye(4), ALONE_ODDS), source, target)
    assert walk.relocalisation.relocalised is None


def test_the_way_since_the_keyframe_counts_when_its_search_ends_later(walk: Pass) -> None:
    for step, metres in enumerate((0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 4.0, 3.0, 2.0, 1.0, 1.0)):
        walk.go(metres, seconds=100.0 + step)
    source, target = place(NOW, 101.0, moved(1.0), 1.0), place(EARLIER, 10.0, T_MAP_ODOM @ moved(1.0), 1.0)
    walk.relocalisation.add_closure(closure(source, target, np.eye(4), ALONE_ODDS), source, target)
    found = walk.relocalisation.relocalised
    assert found is not None and np.allclose(np.diag(found.covariance), np.diag(TIGHT + drift(8.0)))
    for step in range(1, 6):
        walk.go(1.0 + step, seconds=110.0 + step)
    found = walk.relocalisation.relocalised
    assert found is not None and found.covariance[5, 5] == pytest.approx((TIGHT + drift(13.0))[5, 5])


def test_without_odometry_the_newest_keyframe_is_reported() -> None:
    relocalisation = Relocalisation()
    relocalisation.note_frame(frame(100.0, None), NOW)
    source = replace(place(NOW, 100.0, moved(0.3), 0.3), by_odometry=False)
    target = place(EARLIER, 10.0, T_MAP_ODOM, 0.0)
    relocalisation.add_closure(closure(source, target, moved(0.1), ALONE_ODDS), source, target)
    found = relocalisation.relocalised
    assert found is not None and found.stamp_ns == source.stamp_ns
    assert np.allclose(found.T_map_camera, T_MAP_ODOM @ moved(0.1))


def test_a_mean_of_poses_is_nearer_to_the_surer_one_and_surer_than_both() -> None:
    turned = moved(0.3)
    turned[:3, :3] = rotation_from_vector(np.array([0.0, 0.0, 0.3]))
    T, covariance = fused([(np.eye(4), TIGHT), (turned, 2.0 * TIGHT)])
    assert pose_error(T, np.eye(4)) == pytest.approx((np.degrees(0.1), 10.0), rel=1e-3)
    assert np.allclose(covariance, TIGHT / 1.5)


def test_odometry_is_sure_over_no_way_and_less_so_with_each_metre() -> None:
    assert not drift(0.0).any()
    assert np.allclose(drift(2.0), 4.0 * drift(1.0)) and np.all(np.diag(drift(1.0)) > 0)


def test_poses_are_of_the_map_whatever_the_frames_are() -> None:
    walk = Pass()
    walk.close(0.0, odds=ALONE_ODDS)
    found = walk.relocalisation.relocalised
    assert found is not None
    assert np.allclose(inverse(found.T_map_odom) @ found.T_map_camera, np.eye(4), atol=1e-9)


def test_ties_before_the_camera_was_taken_elsewhere_are_forgotten(walk: Pass) -> None:
    for metres in (0.0, 0.2, 0.4):
        walk.close(metres)
    walk.close(0.6, wrong=ASIDE)
    walk.relocalisation.begin_at(round(100.6 * SECOND))
    assert walk.relocalisation.relocalised is None
    walk.close(0.8, wrong=ASIDE)
    found = walk.relocalisation.relocalised
    assert found is not None and found.closures == 2
    assert not np.allclose(found.T_map_odom, T_MAP_ODOM, atol=0.1)


def test_ties_since_it_was_taken_elsewhere_suffice_where_they_agree(walk: Pass) -> None:
    walk.close(0.0)
    walk.close(0.2)
    walk.relocalisation.begin_at(round(100.0 * SECOND))
    found = walk.relocalisation.relocalised
    assert found is not None and found.closures == 2 and np.allclose(found.T_map_odom, T_MAP_ODOM, atol=1e-9)
