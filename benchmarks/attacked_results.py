# SPDX-License-Identifier: Apache-2.0
"""What a run finds of an earlier one, under attack: the JSON of a batch's folder, and the map that a mapper resumes.

What fits is used and must come out as it stands there; all else is refused, with what was expected.
"""

from __future__ import annotations

import io
import json
import os
import random
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from attacked_files import borrowed, plain
from attacked_messages import SECOND, constraint_message, odometry_message
from edits import edited, edited_text
from mutation import flipped, other_float, other_int
from trials import Attempt, Target, WrongAnswerError

from objreg_mapper import saved
from objreg_mapper.params import MapperParams
from objreg_mapper.pose_graph import PoseGraph
from objreg_ros.bridge.messages import from_msg, motion_from_msg
from objreg_tools.cli.many.batch_work import BatchWork
from objreg_tools.cli.recorded import RecordedOptions
from objreg_tools.cli.settings import read_settings
from objreg_tools.report.batch.batch_page import batch_page
from objreg_tools.report.batch.batch_rows import Row
from objreg_tools.report.batch.batch_tables import batch_tables

POSES = 24
BOMB = 1 << 30  # bytes of a member that unpacks from a thousandth of it
INT64 = -(2**63), 2**63 - 1


# -------------------------------------------------------------------------------------------------------------- batches


def result_attempt(folder: Path) -> Attempt:
    """The JSON of a recording, edited; what is read of it goes into the tables and the page."""
    recording = folder / "walk"
    recording.mkdir()
    (recording / "rgb.txt").write_text("")
    work = BatchWork.of(RecordedOptions(read_settings(None, ())), folder, ("batch",))
    good = borrowed("report/batch/test_batch_schema.py").RESULT

    def attempt(draw: random.Random) -> None:
        _place(draw, work.file(recording), good)
        summary = work.read(recording)
        if summary is None:
            return
        work.differing(recording)
        use_result(recording, work.file(recording), summary)

    return attempt


def use_result(recording: Path, file: Path, summary: dict[str, Any]) -> None:
    """As `objreg batch` uses what it found; WrongAnswerError where the row is not what stands in the file."""
    row = Row.of(recording, file.name, summary)
    with batch_tables(file.parent) as tables:
        tables.add_recording(row, summary)
    batch_page([row], {})
    if (row.frames, row.constraints) != (summary["frames"], len(summary["constraints"])):
        raise WrongAnswerError(f"{row.frames} frames and {row.constraints} constraints are not those of the file")


def _place(draw: random.Random, file: Path, good: dict[str, Any]) -> None:
    """What an attacker leaves where a result should be."""
    _remove(file)
    how = draw.random()
    if how < 0.02:
        os.mkfifo(file)
    elif how < 0.04:
        file.mkdir()
    elif how < 0.06:
        file.symlink_to(draw.choice(("/dev/zero", "/dev/full", file.name, "/nowhere/at/all")))
    elif how < 0.2:
        file.write_bytes(flipped(draw, json.dumps(good).encode()))
    else:
        file.write_text(edited_text(draw, good), encoding="utf-8")


def _remove(file: Path) -> None:
    if file.is_dir():
        file.rmdir()
    else:
        file.unlink(missing_ok=True)


# ----------------------------------------------------------------------------------------------------------- saved maps


def saved_map_attempt(folder: Path) -> Attempt:
    """The file of a map, with damaged bytes, other numbers, edited text, or members too few, too many, too large."""
    file, again = folder / "map.npz", folder / "again.npz"
    saved.save(saved.packed(_graph()), file)
    good, truth = file.read_bytes(), said_of(saved.load(file, MapperParams()))
    with np.load(file) as arrays:
        members = {name: arrays[name] for name in arrays.files}

    def attempt(draw: random.Random) -> None:
        damaged = draw.random() < 0.3
        file.write_bytes(flipped(draw, good) if damaged else _with_other_members(draw, members))
        graph = saved.load(file, MapperParams())
        if damaged and said_of(graph) != truth:
            raise WrongAnswerError("a damaged map was loaded as another one")
        require_sound(graph, again)

    return attempt


def _graph() -> PoseGraph:
    graph = PoseGraph()
    for k in range(POSES):
        graph.add_odometry(motion_from_msg.odometry(odometry_message((1 + k) * SECOND, 0.3 * k)))
    for k in range(0, POSES - 9, 3):
        tie = from_msg.loop_closure(constraint_message((1 + k) * SECOND, (9 + k) * SECOND, 2.4))
        assert graph.add_closure(tie)
    graph.optimise()
    return graph


def said_of(graph: PoseGraph) -> Any:
    """All that a map keeps, to be compared."""
    return plain(saved.packed(graph))


def require_sound(graph: PoseGraph, again: Path) -> None:
    """WrongAnswerError unless a map that was loaded has numbers for poses, and is the same once saved again."""
    said = said_of(graph)
    saved.save(saved.packed(graph), again)
    try:
        if said_of(saved.load(again, MapperParams())) != said:
            raise WrongAnswerError("a map is another one once it was saved and loaded")
        graph.optimise()
        poses = [T for path in graph.paths() for _, T in path]
    except ValueError as error:
        raise WrongAnswerError(f"a map that was loaded cannot be used: {error}") from error
    if not np.isfinite(np.array(poses)).all():
        raise WrongAnswerError("a pose of a map that was loaded is no number")


def _with_other_members(draw: random.Random, good: Mapping[str, Any]) -> bytes:
    members, how = dict(good), draw.random()
    name = draw.choice(list(members))
    if how < 0.4:
        said = json.loads(members["told"].tobytes())
        text = json.dumps(edited(draw, said)) if draw.random() < 0.8 else edited_text(draw, said)
        members["told"] = np.frombuffer(text.encode("utf-8", "surrogateescape"), np.uint8)
    elif how < 0.75:
        members[name] = _other_array(draw, members[name])
    elif how < 0.8:
        del members[name]
    elif how < 0.85:
        members[draw.choice(("spare", "../../out", "9_poses", "/tmp/out"))] = members[name]
    elif how < 0.9:
        members[name] = np.array([{}, name], object)  # a pickle
    out = io.BytesIO()
    np.savez_compressed(out, **members)
    if how >= 0.95:
        _add_odd_member(draw, out, name)
    return out.getvalue()


def _other_array(draw: random.Random, array: Any) -> Any:
    """Other numbers, another type or another shape."""
    how, made = draw.random(), array.copy()
    if how < 0.6 and made.size:
        at = draw.randrange(made.size)
        number = other_float(draw, False) if made.dtype.kind == "f" else other_int(draw, *INT64)
        made.flat[at if draw.random() < 0.8 else slice(None)] = (
            number if made.dtype != np.uint8 else draw.randrange(256)
        )
        return made
    shapes = made[:-1], made[:0], made.ravel(), made[None], np.concatenate([made, made]) if made.ndim else made
    types = made.astype(np.float32), made.astype(np.complex128), made.astype("S3"), made.astype(np.int16), made * 1j
    return draw.choice((*shapes, *types))


def _add_odd_member(draw: random.Random, out: io.BytesIO, name: str) -> None:
    """A member that is there twice, or as large as a memory."""
    with zipfile.ZipFile(out, "a", zipfile.ZIP_DEFLATED) as archive:
        if draw.random() < 0.5:
            archive.writestr(f"{name}.npy", b"twice")
        else:
            archive.writestr("spare.npy", bytes(BOMB >> 4), compresslevel=1)


TARGETS = [Target("result", result_attempt), Target("saved_map", saved_map_attempt)]
