# SPDX-License-Identifier: Apache-2.0
"""A pose graph in a file that keeps its sessions, so that another day goes on in its map. numpy's npz."""

from __future__ import annotations

import json
import zipfile
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from objreg_mapper.constraint import Constraint
from objreg_mapper.optimisation.problem import End, Tie
from objreg_mapper.params import MapperParams
from objreg_mapper.pose_graph import PoseGraph
from objreg_mapper.session import Session, stacked
from objreg_ros.data.checked import Array
from objreg_ros.data.closure_fields import closure_of, fields_of
from objreg_ros.data.closures import LoopClosure
from objreg_ros.whole_file import whole_file

VERSIONS = 1, 2  # before robots, and now
MOST_BYTES = 400_000_000  # of a file and of what is unpacked from it: a day of odometry has some 50 million
BROKEN = (
    *(KeyError, IndexError, TypeError, ValueError, ArithmeticError, AttributeError, EOFError, MemoryError),
    *(RuntimeError, zipfile.BadZipFile, zlib.error),
)  # what numpy, zipfile and json say of a file that is not whole


NUMBERS = {"T_from_to": "T_from_to", "covariance": "closure_covariances"}  # fields of a closure, in arrays of their own
OF_CLOSURES = ("ends", "T_1_2", "covariances", *NUMBERS.values())  # a row for each


def beside(graph_path: Path) -> Path:
    """Where the sessions of a map are whose g2o text is at ``graph_path``."""
    return graph_path.with_name(f"{graph_path.stem if graph_path.suffix != '.npz' else graph_path.name}.npz")


def _without_numbers(closure: LoopClosure) -> dict[str, Any]:
    return {name: value for name, value in fields_of(closure).items() if name not in NUMBERS}


def packed(graph: PoseGraph) -> dict[str, Any]:
    """All of a graph in arrays, for `save`, which takes longer."""
    ties = graph.closure_ties
    header = {
        "version": VERSIONS[-1],
        "names": [sorted(session.names) for session in graph.sessions],
        "robots": [session.robot for session in graph.sessions],
        "closures": [_without_numbers(tie.closure) for tie in ties if tie.closure],
    }
    arrays: dict[str, Any] = {
        "told": np.frombuffer(json.dumps(header).encode(), np.uint8),
        "ends": np.array([(*tie.end1, *tie.end2) for tie in ties], np.int64).reshape(-1, 4),
        "T_1_2": stacked([tie.constraint.T_from_to for tie in ties]),
        "covariances": np.array([tie.constraint.covariance for tie in ties]).reshape(-1, 6, 6),
        "T_from_to": stacked([tie.closure.T_from_to for tie in ties if tie.closure]),
        "closure_covariances": np.array([tie.closure.covariance for tie in ties if tie.closure]).reshape(-1, 6, 6),
    }
    for number, session in enumerate(graph.sessions):
        arrays.update({f"{number}_{name}": value for name, value in session.arrays().items()})
    return arrays


def save(arrays: Mapping[str, Any], path: Path) -> None:
    """Write what is `packed`, whole or not at all. OSError where that cannot be."""
    with whole_file(path) as file:
        np.savez_compressed(file, **arrays)


def load(path: Path, params: MapperParams) -> PoseGraph:
    """The graph of a file, unsolved; the odometry of each robot goes on in a session of its own.

    OSError where it cannot be read, ValueError where it is not what `save` writes.
    """
    size = path.stat().st_size
    if size > MOST_BYTES:
        raise ValueError(f"{path}: expected a map of at most {MOST_BYTES} bytes, got {size}")
    try:
        with zipfile.ZipFile(path) as archive:
            unpacked = sum(entry.file_size for entry in archive.infolist())
        if unpacked > MOST_BYTES:
            raise ValueError(f"expected at most {MOST_BYTES} bytes unpacked, got {unpacked}")
        with np.load(path, allow_pickle=False) as arrays:
            header = json.loads(arrays["told"].tobytes())
            _require_members(header, arrays.files)
            return _graph(header, {name: arrays[name] for name in arrays.files}, params)
    except BROKEN as error:
        raise ValueError(f"{path}: expected a map that ~/save wrote, got a file that is none: {error}") from error


def _require_members(header: Mapping[str, Any], names: Sequence[str]) -> None:
    """ValueError unless a file has what it says, and nothing else, before that is unpacked."""
    if header["version"] not in VERSIONS:
        raise ValueError(f"version: expected {' or '.join(map(str, VERSIONS))}, got {header['version']!r}")
    if not header["names"]:
        raise ValueError("expected at least one session, got none")
    expected = {"told", *OF_CLOSURES, *(f"{k}_{key}" for k in range(len(header["names"])) for key in Session.ARRAYS)}
    if len(names) != len(expected) or expected.symmetric_difference(names):
        odd = sorted(expected.symmetric_difference(names)) or sorted(names)
        raise ValueError(f"expected arrays of {len(header['names'])} sessions, got more or fewer: {', '.join(odd[:3])}")


def _graph(header: Mapping[str, Any], arrays: Mapping[str, Array], params: MapperParams) -> PoseGraph:
    if odd := sorted(name for name, array in arrays.items() if array.dtype.kind not in "fiu"):
        raise ValueError(f"expected real numbers, got others in {', '.join(odd[:3])}")
    counts = {name: len(arrays[name]) for name in OF_CLOSURES}
    if set(counts.values()) != {len(header["closures"])}:
        raise ValueError(f"expected {len(header['closures'])} closures everywhere, got {counts}")
    graph = PoseGraph(params)
    graph.sessions.clear()
    robots = header.get("robots", [""] * len(header["names"]))
    for number, (names, robot) in enumerate(zip(header["names"], robots, strict=True)):
        session = Session.of_arrays({key: arrays[f"{number}_{key}"] for key in Session.ARRAYS})
        session.names, session.robot = {int(name) for name in names}, str(robot)
        graph.sessions.append(session)
    for number, known in enumerate(header["closures"]):
        closure = closure_of({**known, **{name: arrays[held][number] for name, held in NUMBERS.items()}})
        s1, k1, s2, k2 = arrays["ends"][number].tolist()
        constraint = Constraint(arrays["T_1_2"][number], arrays["covariances"][number])
        graph.restore(Tie(End(s1, k1), End(s2, k2), constraint, closure))
    return graph
