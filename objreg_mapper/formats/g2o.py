# SPDX-License-Identifier: Apache-2.0
"""g2o's text: ``VERTEX_SE3:QUAT`` and ``EDGE_SE3:QUAT``, for g2o, GTSAM, RTAB-Map and SE-Sync.

The file has nothing else. A comment or a ``FIX`` ends the reading of Ceres' examples, and SE-Sync takes it for one more
edge; who solves the graph fixes a vertex. So the times of the vertices are in a file of their own, `times_file`.

The information is of ``[translation, rotation vector]`` in the axes of *to*, as GTSAM reads it. g2o itself takes the
last three for half the rotation vector and so trusts rotations a quarter as much; RTAB-Map does as the one of the two
that it solves with. Ceres' example reads the file, but weighs by the axes of *from* (docs/conventions.md).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from objreg_mapper.constraint import Constraint, local_information
from objreg_ros.data.checked import Array
from objreg_ros.geometry import quaternion_from_rotation

TIMES, TIMES_END = "vertex,stamp_ns,session", ".times.csv"  # the first line of the times, the end of their name


def graph_text(poses: Sequence[Array], edges: Iterable[tuple[int, int, Constraint]]) -> str:
    """The file: vertices 0, 1, … at ``T_map_body (4, 4)`` and edges ``(from, to, constraint)``.

    A constraint is between the bodies at its two vertices, as `between_keyframes` makes it: not between cameras.
    """
    lines = [f"VERTEX_SE3:QUAT {i} {_pose_text(T)}" for i, T in enumerate(poses)]
    lines += [edge_text(*edge) for edge in edges]
    return "".join(line + "\n" for line in lines)


def times_file(graph: Path) -> Path:
    """Where the times of the vertices of a file are: beside it, ``map.g2o.times.csv``."""
    return graph.with_name(f"{graph.name}{TIMES_END}")


def times_text(vertices: Iterable[tuple[int, int]]) -> str:
    """The times: a line for each vertex, with its number, its stamp in ns and the number of its session from 0.

    ``vertices`` are stamps and sessions, in the order of the vertices. A session is a run of odometry: stamps of two
    sessions may be of two clocks.
    """
    rows = [f"{i},{stamp_ns},{session}" for i, (stamp_ns, session) in enumerate(vertices)]
    return "".join(line + "\n" for line in (TIMES, *rows))


def edge_text(from_id: int, to_id: int, constraint: Constraint) -> str:
    """One edge: ids, ``T_from_to`` of the vertices, and the upper triangle of the information row by row."""
    upper = local_information(constraint)[np.triu_indices(6)]
    numbers = " ".join(f"{value:.9g}" for value in upper)
    return f"EDGE_SE3:QUAT {from_id} {to_id} {_pose_text(constraint.T_from_to)} {numbers}"


def _pose_text(T: Array) -> str:
    return " ".join(f"{value:.9f}" for value in (*T[:3, 3], *quaternion_from_rotation(T[:3, :3])))
