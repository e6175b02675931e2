# SPDX-License-Identifier: Apache-2.0
"""What the edges above a camera are: its odometry, its ground truth, or a joint of the robot."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator

from objreg_ros.bridge.camera.frames import FrameEdge, FrameTie, FrameTree, is_world
from objreg_ros.geometry import rotation_angle

ODOM = re.compile(r"(^|[/_])(odom\w*|init)([/_]|$)", re.IGNORECASE)
BASES = ("base_link", "base_footprint", "base", "body", "chassis", "base_frame", "robot_base")
BASE = re.compile(rf"(^|/|robot\w*_)({'|'.join(BASES)})$", re.IGNORECASE)
MOST_BASES = 20  # of several robots
TRAVEL_M = 0.1  # a body goes farther than a joint that turns; a lift may too, but it stands on a base
LEVEL = 1e-3  # m and rad: of two bases above each other odometry in the plane says the same


def odometry_edge(tree: FrameTree, camera: str, outright: bool = False) -> FrameEdge | None:
    """The edge above a camera that is odometry, as odom → base_link: its parent is called so, or it is the root.

    A root without such a name has to be no part of a robot, and its child must have travelled. What moves goes before
    what has not moved yet, then the lower one. A map or a motion capture is odometry only if it is asked for
    ``outright``, and there is no other. None where there is none.
    """
    edges, above = _unfixed(tree, camera), [edge for edges in tree.above(camera) for edge in edges]
    named = [edge for edge in edges if ODOM.search(edge.parent) and not is_world(edge.child)]
    roots = [edge for edge in edges if not is_world(edge.parent) and _is_root(edge, above)]
    worlds = [edge for edge in edges if is_world(edge.parent) and not is_world(edge.child)] if outright else []
    for found in (named, roots, worlds):
        if found:
            return min(found, key=lambda edge: not edge.moves)
    return None


def truth_edge(tree: FrameTree, camera: str) -> FrameEdge | None:
    """The edge above a camera that is its ground truth, as world → kinect; None where there is none that moves."""
    edges = (edge for edge in _unfixed(tree, camera) if edge.moves and is_world(edge.parent))
    return next((edge for edge in edges if not ODOM.search(edge.parent) and not is_world(edge.child)), None)


def body_of(tree: FrameTree, odom_frame: str, camera: str) -> str:
    """The body of an odometry that does not name it; empty where nothing gives it.

    It is the frame by which the camera hangs on ``odom_frame``: of those between the highest that moves. Where the
    camera does not hang there, it is the well-known base that carries the camera.
    """
    below = [edge for edges in tree.above(camera) for edge in edges]
    names = [camera, *(edge.parent for edge in below)]
    if odom_frame and odom_frame in names:
        return _hanging(tree, odom_frame, camera)
    return _well_known(tree, camera)


def _hanging(tree: FrameTree, odom_frame: str, camera: str) -> str:
    """The child of the highest moving edge at or below ``odom_frame``, down to the base; the first child if none is."""
    path: list[FrameEdge] = []
    for edges in tree.above(camera):
        path.append(next((edge for edge in edges if edge.parent == odom_frame), edges[0]))
        if path[-1].parent == odom_frame:
            break
    above = [edge for edge in reversed(path) if is_world(edge.parent) or edge.parent == odom_frame]
    return next((edge.child for edge in above if edge.moves), above[-1].child)


def _well_known(tree: FrameTree, camera: str) -> str:
    bases = sorted({name for name in tree.names() if BASE.search(name)} - {camera}, key=_rank)
    tied = [name for name in bases[:MOST_BASES] if tree.tie(name, camera) is not None]
    return tied[0] if tied and all(_is_level(tree, tied[0], other) for other in tied[1:]) else ""


def _rank(name: str) -> tuple[int, str]:
    found = BASE.search(name)
    return (BASES.index(found[2].lower()) if found else len(BASES)), name


def _is_level(tree: FrameTree, a: str, b: str) -> bool:
    """Whether two bases are one straight above the other."""
    T = tree.between(a, b) if tree.tie(a, b) in (FrameTie.STATIC, FrameTie.CONSTANT) else None
    return T is not None and max(*abs(T[:2, 3]), rotation_angle(T[:3, :3])) < LEVEL


def _unfixed(tree: FrameTree, camera: str) -> list[FrameEdge]:
    """The edges above a camera that are on /tf, the lowest first."""
    return [edge for edges in tree.above(camera) for edge in edges if edge.fixed is None]


def _is_root(edge: FrameEdge, edges: Iterable[FrameEdge]) -> bool:
    """Whether a frame travels in a root that is no part of a robot."""
    is_highest = all(other.child != edge.parent or is_world(other.parent) for other in edges)
    return is_highest and edge.extent > TRAVEL_M and not BASE.search(edge.parent)


def names_of(edge: FrameEdge) -> str:
    """Both frames, for a user."""
    return f"{edge.parent} → {edge.child}"


def moved(message: object, edge: FrameEdge) -> Iterator[object]:
    """The transforms of a TFMessage that are of an edge."""
    for one in message.transforms:  # type: ignore[attr-defined]
        if (one.header.frame_id.lstrip("/"), one.child_frame_id.lstrip("/")) == (edge.parent, edge.child):
            yield one
