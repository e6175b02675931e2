# SPDX-License-Identifier: Apache-2.0
"""From a frame window to a keyframe: objects seen from several frames become one cloud each, views become context."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.frames import UNNAMED, Frame, ObjectCloud, PointFlag, View
from objreg_ros.geometry import inverse, rigid, rotate, transform
from objreg_ros.keyframes.frame_window import FrameWindow
from objreg_ros.keyframes.own_size import FRAME_POINTS, OBJECT_POINTS, best, sized_context, thinned
from objreg_ros.keyframes.tracking import SAME_PICTURE, TrackedSurface, same_picture, tracked_surface, view_motion
from objreg_ros.registration.keyframe import Context, Keyframe, KeyObject, bounding_box
from objreg_ros.registration.labels import LabelGroups
from objreg_ros.registration.params import ContextParams
from objreg_ros.registration.prepare.normals import view_normals
from objreg_ros.registration.prepare.voxels import _keys, thin

OBJECT_VOXEL_M = 0.004  # edge of a voxel when the frames of an object are fused: finer than a Kinect's pixels at 1 m
CONTEXT_RADIUS_M = 1.0  # how far around an object the context reaches: a table, not a room
CONTEXT_VOXEL_M = 0.03  # edge of a voxel of the context; finer ones gain nothing
Box = tuple[Array, float]  # middle (3,) and extent of a cloud, m
CUT = np.uint16(PointFlag.CUT_BY_IMAGE | PointFlag.CUT_BY_BOX)
CENTRE_SPREAD = 0.05  # m: how far the middle of one small object wanders between neighbouring frames


def fuse(window: FrameWindow, params: ContextParams) -> Keyframe:
    """The keyframe of a frame window, in the camera frame of its reference; its id is 0 until a store gives one."""
    chosen = reference_index(window.frames)
    reference = window.frames[chosen]
    motions = motions_to(window, chosen)
    objects = fuse_objects(window.frames, motions, params.label_groups)
    return Keyframe(
        keyframe_id=0,
        session=window.session,
        stamp_ns=reference.stamp_ns,
        frame_id=reference.frame_id,
        objects=objects,
        context=fuse_context(window.frames, motions, objects, params.context_range),
        view=reference.view,
        gravity=reference.gravity,
        gravity_confidence=reference.gravity_confidence,
        T_odom_camera=rigid(window.T_session_first @ window.T_first_frame[chosen]),
        by_odometry=window.by_odometry,
        travelled=window.travelled,
        turned=window.turned,
        robot=reference.robot,
    )


def motions_to(window: FrameWindow, chosen: int) -> list[Array]:
    """``T_reference_frame`` of each frame: by the window's track, or by the views where odometry shows another picture.

    Odometry that jitters from one frame to the next would smear the objects. Our own tracking has looked already.
    """
    T_reference_first = inverse(window.T_first_frame[chosen])
    motions = [T_reference_first @ T for T in window.T_first_frame]
    if not window.by_odometry or len(motions) == 1:
        return motions
    surface = tracked_surface(window.frames[chosen].view)
    return [
        T if k == chosen else _as_seen(frame.view, surface, T)
        for k, (frame, T) in enumerate(zip(window.frames, motions, strict=True))
    ]


def _as_seen(view: View, surface: TrackedSurface, T_reference_frame: Array) -> Array:
    """The motion by the views where they show the same picture by that, and not by the one that is given."""
    shown = same_picture(view, surface, T_reference_frame)
    if shown >= SAME_PICTURE:
        return T_reference_frame
    T_seen = view_motion(view, surface, T_reference_frame)
    if T_seen is None or same_picture(view, surface, T_seen) < max(shown, SAME_PICTURE):
        return T_reference_frame
    return rigid(T_seen)


def reference_index(frames: Sequence[Frame]) -> int:
    """The frame that shows most: objects first, then how sharp its grey is. The earliest of equals."""
    ranks = [(len(f.objects), _sharpness(f.view.grey)) for f in frames]
    return max(range(len(frames)), key=lambda i: (*ranks[i], -i))


def fuse_objects(
    frames: Sequence[Frame], T_reference_frame: Sequence[Array], label_groups: Sequence[str]
) -> tuple[KeyObject, ...]:
    """Every object once: the same label group at the same place is the same object, seen from several sides.

    One without points is nowhere, and is passed over. So is one without a name that only one of several frames shows;
    where another frame names it, it is that. Of more than `own_size.OBJECTS` those that were surest are kept.
    """
    groups = LabelGroups(label_groups)
    tracks: list[_Track] = []
    for frame, T in zip(frames, T_reference_frame, strict=True):
        free = list(tracks)
        for item in (item for item in frame.objects if len(item)):
            sighting = _moved(item, T)
            box = bounding_box(sighting.xyz)
            track = _nearest(sighting, box, free, groups)
            if track is None:
                tracks.append(_Track([sighting], box))
            else:
                free.remove(track)
                track.sightings.append(sighting)
                track.box = box
    kept = [track for track in tracks if track.name != UNNAMED or len(track.sightings) > 1 or len(frames) == 1]
    surest = best(kept, lambda track: max(sighting.score for sighting in track.sightings))
    return tuple(track.fused(number) for number, track in enumerate(surest, start=1))


def fuse_context(
    frames: Sequence[Frame], T_reference_frame: Sequence[Array], objects: Sequence[KeyObject], range_m: float
) -> Context:
    """What the views saw within the context's radius of any object, thinned to voxels, with the mean normals."""
    seen = [_surface(frame, T, range_m) for frame, T in zip(frames, T_reference_frame, strict=True)]
    points, normals = (np.concatenate(part) for part in zip(*seen, strict=True))
    xyz, directions = thin(points, normals, CONTEXT_VOXEL_M)
    near = _near(xyz, [item.centroid for item in objects], CONTEXT_RADIUS_M)
    return sized_context(Context(xyz=xyz[near], normals=directions[near]))


def _surface(frame: Frame, T_reference_frame: Array, reach: float) -> tuple[Array, Array]:
    """Points and normals of a view, every second one each way: four frames make up for it."""
    xyz, normals = frame.view.xyz[::2, ::2], view_normals(frame.view.xyz)[::2, ::2]
    known = (normals[..., 2] != 0) & (xyz[..., 2] < reach)
    return transform(T_reference_frame, xyz[known]), rotate(T_reference_frame, normals[known])


@dataclass(slots=True, eq=False)
class _Track:
    """The sightings of one object, all in the reference frame, and the bounding box of the last."""

    sightings: list[ObjectCloud]
    box: Box

    @property
    def name(self) -> str:
        """The last label that a detector gave, `UNNAMED` if none did."""
        return next((s.label for s in reversed(self.sightings) if s.label != UNNAMED), UNNAMED)

    def fused(self, instance: int) -> KeyObject:
        named = [s for s in self.sightings if s.label != UNNAMED] or self.sightings
        best = max(named, key=lambda s: s.score)
        whole = [s for s in named if not (s.has(PointFlag.CUT_BY_IMAGE) or s.has(PointFlag.CUT_BY_BOX))]
        kept = whole or named
        votes: Counter[str] = Counter()
        for sighting in named:
            votes[sighting.label] += round(1000 * sighting.score)
        label = max(votes, key=lambda name: (votes[name], name))
        return KeyObject(cloud=_merge(kept, label, best, instance), sightings=len(self.sightings))


def _merge(sightings: Sequence[ObjectCloud], label: str, best: ObjectCloud, instance: int) -> ObjectCloud:
    """The first point of each voxel, and of those every so many: a point keeps its own colour, normal and flags."""
    xyz = np.concatenate([s.xyz for s in sightings])
    first = np.unique(_keys(xyz, OBJECT_VOXEL_M), return_index=True)[1]
    first = first[:: 1 + (len(first) - 1) // OBJECT_POINTS]
    coloured = [s.rgb for s in sightings if s.rgb is not None]
    return ObjectCloud(
        label=label,
        score=best.score,
        instance=instance,
        xyz=xyz[first],
        normals=np.concatenate([s.normals for s in sightings])[first],
        rgb=np.concatenate(coloured)[first] if len(coloured) == len(sightings) else None,
        flags=np.concatenate([s.flags for s in sightings])[first],
        density=best.density,
    )


def _nearest(item: ObjectCloud, box: Box, tracks: Sequence[_Track], groups: LabelGroups) -> _Track | None:
    """The track whose last sighting is the same object; ``box`` is the item's."""
    group = None if item.label == UNNAMED else groups.of(item.label)
    near, nearest_m = None, np.inf
    for track in tracks:
        if group is not None and track.name != UNNAMED and groups.of(track.name) != group:
            continue
        distance = math.dist(box[0], track.box[0])
        if distance < min(nearest_m, CENTRE_SPREAD + 0.25 * min(box[1], track.box[1])):
            near, nearest_m = track, distance
    return near


def _moved(item: ObjectCloud, T: Array) -> ObjectCloud:
    """The cloud in another frame, of no more points than a keyframe needs."""
    few = thinned(item, FRAME_POINTS)
    return replace(few, xyz=transform(T, few.xyz), normals=rotate(T, few.normals))


def _near(points: Array, centres: Sequence[Array], radius: float) -> Array:
    near = np.zeros(len(points), bool)
    for centre in centres:
        near |= np.square(points - centre.astype(np.float32)).sum(axis=1) < radius**2
    return near


def _sharpness(grey: Array | None) -> float:
    """The mean squared difference of neighbours: blur by motion takes it away."""
    if grey is None:
        return 0.0
    pixels = grey.astype(np.float32)
    return float(np.square(np.diff(pixels, axis=0)).mean() + np.square(np.diff(pixels, axis=1)).mean())
