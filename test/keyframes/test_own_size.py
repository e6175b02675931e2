# SPDX-License-Identifier: Apache-2.0
"""What comes in is brought to the size at which the registrar works, and each step's cost is bounded by that."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from registration.samples import box, cloud, frame, keyframe, scene_view

from objreg_ros import limits
from objreg_ros.data.frames import Frame, ObjectCloud, View
from objreg_ros.data.images import Intrinsics
from objreg_ros.geometry import back_project
from objreg_ros.keyframes import own_size
from objreg_ros.keyframes.own_size import sized_frame, sized_keyframe
from objreg_ros.memory import retrieval
from objreg_ros.memory.compact import pack_keyframe, unpack_keyframe
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registrar.registrar import Registrar
from objreg_ros.registration.keyframe import Context, KeyObject


def wall(width: int, height: int) -> View:
    """A wall at 2 m, painted with a ramp."""
    camera = Intrinsics(
        fx=width + height, fy=width + height, cx=width / 2.0, cy=height / 2.0, width=width, height=height
    )
    xyz = back_project(np.full((height, width), 2.0, np.float32), camera.fx, camera.fy, camera.cx, camera.cy)
    grey = np.tile(np.linspace(0, 255, width).astype(np.uint8), (height, 1))
    return View(xyz=xyz, grey=grey, intrinsics=camera)


def crowd(count: int, points: int = 400) -> tuple[ObjectCloud, ...]:
    """Objects of one label, all over the picture."""
    random = np.random.default_rng(0)
    places = random.uniform((-1.0, -0.8, 1.0), (1.0, 0.8, 3.0), (count, 3))
    clouds = [cloud("cup", random.normal(place, 0.03, (points, 3)), k + 1) for k, place in enumerate(places)]
    return tuple(replace(one, score=round(0.5 + 0.4 * (k % 7) / 7.0, 3)) for k, one in enumerate(clouds))


def test_what_is_smaller_stays_as_it_is() -> None:
    small = frame(1.0, (box("cup", (0, 0, 1)),))
    sized = sized_frame(small)
    assert sized.view is small.view and sized.objects[0] is small.objects[0]
    stored = keyframe()
    assert sized_keyframe(stored).objects[0].cloud is stored.objects[0].cloud
    assert sized_keyframe(stored).context is stored.context


@pytest.mark.parametrize("size", [(800, 600), (1000, 600), (600_000, 1), (1, 600_000)])
def test_a_large_view_shows_the_same_with_fewer_pixels(size: tuple[int, int]) -> None:
    large = wall(*size)
    small = sized_frame(frame(1.0, view=large)).view
    camera = small.intrinsics
    assert camera.width * camera.height <= limits.OWN_VIEW_PIXELS < size[0] * size[1]
    again = back_project(small.xyz[..., 2], camera.fx, camera.fy, camera.cx, camera.cy)
    np.testing.assert_allclose(small.xyz, again, atol=1e-4)
    assert small.grey is not None and small.grey.shape == (camera.height, camera.width)
    assert abs(float(small.grey.mean()) - float(large.grey.mean())) < 2.0


def test_the_surest_objects_are_kept_in_their_order() -> None:
    objects = crowd(limits.MOST_OBJECTS)
    kept = sized_frame(frame(1.0, objects)).objects
    assert len(kept) == own_size.OBJECTS
    assert [one.instance for one in kept] == sorted(one.instance for one in kept)
    assert min(one.score for one in kept) >= max(one.score for one in objects if one not in kept)


def test_a_keyframe_from_elsewhere_is_cut_to_its_own_size_as_it_is_unpacked() -> None:
    made = keyframe()
    points = np.random.default_rng(0).uniform((-1, -1, 1), (1, 1, 2), (60_000, 3)).astype(np.float32)
    large = replace(
        made,
        objects=tuple(KeyObject(cloud=one) for one in crowd(100, points=2500)),
        context=Context(xyz=points, normals=np.tile(np.float32([0, 0, -1]), (len(points), 1))),
        view=wall(600, 400),
    )
    got = unpack_keyframe(pack_keyframe(large, limits.MOST_PACKED_KEYFRAME))
    assert len(got.objects) == own_size.OBJECTS
    assert max(len(item.cloud) for item in got.objects) <= own_size.OBJECT_POINTS
    assert len(got.context) <= own_size.CONTEXT_POINTS
    assert got.view.intrinsics.width * got.view.intrinsics.height <= limits.OWN_VIEW_PIXELS


def test_every_step_of_a_keyframe_has_a_bound_at_the_limits_of_a_frame(monkeypatch: pytest.MonkeyPatch) -> None:
    """What fusing, describing, retrieving and storing have to do is counted, not timed."""
    pairs: list[int] = []
    tally = retrieval._KERNELS.tally

    def counted(keyframe_ids: np.ndarray, *others: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        objects = np.unique(keyframe_ids, return_counts=True)[1]
        pairs.extend((objects * (objects - 1) // 2).tolist())
        return tuple(tally(keyframe_ids, *others))

    monkeypatch.setattr(retrieval._KERNELS, "tally", counted)
    registrar = Registrar(RegistrarParams(candidates=1))
    for seconds in (0.0, 10.0, 20.0):
        registrar.track(at_the_limits(seconds))
        (window,) = registrar.end_windows()
        outcome = registrar.search(window, 0.0)
        stored = registrar._store.keyframe(outcome.keyframe_id)
        assert len(stored.objects) == own_size.OBJECTS
        assert max(len(item.cloud) for item in stored.objects) <= own_size.OBJECT_POINTS
        assert stored.nbytes < 20_000_000
    assert len(pairs) == 3 and max(pairs) <= (own_size.OBJECTS * retrieval.SHORTLIST) ** 2 / 2
    assert registrar.counts()["objects"] <= 3 * own_size.OBJECTS
    registrar.close()


def at_the_limits(seconds: float) -> Frame:
    """A frame that is as large as one may be that comes in: many alike, many points, many pixels."""
    return frame(
        seconds, crowd(limits.MOST_OBJECTS, limits.MOST_OBJECT_POINTS // limits.MOST_OBJECTS), view=wall(1000, 600)
    )


def test_a_scene_as_usual_is_below_every_bound() -> None:
    assert scene_view().intrinsics.width * scene_view().intrinsics.height < limits.OWN_VIEW_PIXELS / 5
