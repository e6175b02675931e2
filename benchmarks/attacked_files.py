# SPDX-License-Identifier: Apache-2.0
"""Damaged files: stores, recordings and models with flipped bits, cut ends and metadata that lie.

A store must say exactly what was written, or refuse and stay as it is. A recording or a model may say something else,
as neither carries a checksum of all that it says, but must not end, fill or stop the process.
"""

from __future__ import annotations

import base64
import importlib.util
import json
import random
import shutil
from collections.abc import Callable
from contextlib import closing
from dataclasses import fields, is_dataclass
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from mutation import flipped
from rosbags.rosbag2 import StoragePlugin
from store import make_keyframe
from trials import Attempt, Target, WrongAnswerError

from objreg_ros.data.closures import LoopClosure
from objreg_ros.data.images import ColourImage
from objreg_ros.detector.detector import Detector
from objreg_ros.detector.params import DetectorParams
from objreg_ros.memory.sighting import sightings_of
from objreg_ros.memory.store import Store
from objreg_tools.recording.opening import open_recording
from objreg_tools.recording.rosbag.writer import write_rosbag2

TESTS = Path(__file__).resolve().parents[1] / "test"
KEYFRAMES = 3
DEEP = 100_000
FLOATS = (float("nan"), float("inf"), -1.0, 0.0, 1e30, 3e38)


def borrowed(path: str) -> ModuleType:
    """A file of the tests that makes small things, which are the same here."""
    spec = importlib.util.spec_from_file_location(f"borrowed_{Path(path).stem}", TESTS / path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


# --------------------------------------------------------------------------------------------------------------- stores


def store_attempt(folder: Path) -> Attempt:
    """Bits of a store flip; what it says is that which was written, or it is refused and left alone."""
    whole, place = folder / "whole.db", folder / "damaged.db"
    write_store(whole)
    good, truth = whole.read_bytes(), _said(whole, True)

    def attempt(draw: random.Random) -> None:
        for left in folder.glob("damaged*"):
            left.unlink()
        damaged, read_only = _damaged(draw, good), draw.random() < 0.7
        place.write_bytes(damaged)
        try:
            said = _said(place, read_only)
        except (ValueError, OSError):
            if place.read_bytes() != damaged:
                raise WrongAnswerError("a store that was refused was changed") from None
            raise
        wrong = next((name for name in truth if said.get(name) != truth[name]), None)
        if wrong is not None:
            raise WrongAnswerError(f"{wrong}: read otherwise than it was written")

    return attempt


def _damaged(draw: random.Random, good: bytes) -> bytes:
    """One bit in most tries: checksums find the rest all the more easily."""
    if draw.random() < 0.3:
        return flipped(draw, good)
    made, head = bytearray(good), draw.choice((len(good), len(good), 100, 4096))
    made[draw.randrange(head)] ^= 1 << draw.randrange(8)
    return bytes(made)


def write_store(path: Path) -> None:
    """A store of `KEYFRAMES` keyframes with their objects and closures."""
    draw = np.random.default_rng(0)
    with closing(Store(path)) as store:
        for k in range(KEYFRAMES):
            keyframe = make_keyframe(store.next_keyframe(), draw, 30)
            tie = LoopClosure(
                from_ns=k, to_ns=k + 10**9, T_from_to=np.eye(4), covariance=np.eye(6) * 1e-4, labels=("cup",),
                evidence={"correlation": 0.5 + k},
            )  # fmt: skip
            sightings = [s.of_landmark(8 * k + n + 1, np.eye(3)) for n, s in enumerate(sightings_of(keyframe))]
            store.write_keyframe(keyframe, sightings, [tie])


def _said(path: Path, read_only: bool) -> dict[str, Any]:
    """All that a store can be asked for."""
    with closing(Store(path, read_only=read_only)) as store:
        ids = store.keyframe_ids()
        answers = {f"keyframe {k}": store.keyframe(k) for k in ids}
        counts, last = store.counts(), store.sessions_beyond("", 10, 0)
        nexts = store.next_keyframe(), store.next_landmark(), store.next_session()
        rest = {"ids": ids, "counts": counts, "next": nexts, "beyond": store.beyond(1), "last": last}
        listed = {"sightings": list(store.sightings()), "closures": list(store.closures())}
        return {name: plain(value) for name, value in {**answers, **rest, **listed}.items()}


def plain(value: Any) -> Any:
    """A value as things that can be compared."""
    if isinstance(value, np.ndarray):
        return value.dtype.str, value.shape, value.tobytes()
    if is_dataclass(value):
        return {field.name: plain(getattr(value, field.name)) for field in fields(value)}
    if isinstance(value, dict):
        return {name: plain(item) for name, item in value.items()}
    return [plain(item) for item in value] if isinstance(value, list | tuple) else value


# ----------------------------------------------------------------------------------------------------------- recordings


def bag_attempt(kind: str, folder: Path) -> Attempt:
    """Bytes of one file of a recording change; it is opened, and every record is read."""
    whole, place = folder / "whole", folder / "damaged"
    made = _write_recording(kind, whole)
    files = sorted(path.relative_to(folder) for path in _files(made))
    if any(path.suffix == ".txt" for path in files):  # a picture is worth less than a list
        files += [path for path in files if path.suffix in (".txt", ".yaml")] * 3

    def attempt(draw: random.Random) -> None:
        shutil.rmtree(place, ignore_errors=True)
        chosen = draw.choice(files)
        for path in set(files):
            data = (folder / path).read_bytes()
            there = place / path
            there.parent.mkdir(parents=True, exist_ok=True)
            there.write_bytes(_spoilt(draw, data) if path == chosen else data)
        _read_all(place / made.relative_to(folder))

    return attempt


def _files(path: Path) -> list[Path]:
    return [path] if path.is_file() else [found for found in path.rglob("*") if found.is_file()]


def _write_recording(kind: str, path: Path) -> Path:
    folders = borrowed("recording/sample_folders.py")
    path.mkdir()
    if kind == "tum":
        return Path(folders.tum_folder(path / "walk"))
    if kind == "rosbag1":
        return Path(folders.noetic_bag(path / "walk.bag", 2))
    if kind == "sqlite3":
        return Path(folders.humble_bag(path / "walk", StoragePlugin.SQLITE3))
    if kind == "zstd":
        write_rosbag2(path / "walk", folders.records(2))
        return path / "walk"
    return Path(folders.robot_bag(path / "walk", 2))


def _spoilt(draw: random.Random, data: bytes) -> bytes:
    head = draw.choice((len(data), len(data), 4096, 128))
    return flipped(draw, data[:head]) + data[head:]


def _read_all(path: Path) -> None:
    with open_recording(path) as recording:
        recording.obstacles()
        _ = recording.latched, recording.seconds
        for record in recording.records():
            record.read()


# --------------------------------------------------------------------------------------------------------------- models


def model_attempt(folder: Path) -> Attempt:
    """Bytes or metadata of a tiny model change; it is loaded, and sees one picture."""
    tiny = borrowed("detector/tiny_model.py")
    paths = _write_models(tiny, folder)
    picture = ColourImage(rgb=np.zeros((30, 40, 3), np.uint8), stamp_ns=0)

    def attempt(draw: random.Random) -> None:
        path, place = draw.choice(paths), folder / "damaged.onnx"
        lie = ""
        if draw.random() < 0.5:
            place.write_bytes(_spoilt(draw, path.read_bytes()))
        else:
            lie = _lie(draw, tiny.onnx, path, place)
        found = Detector(DetectorParams(threads=1), place).detect(picture)
        if lie:
            raise WrongAnswerError(f"{lie} passes, with {len(found)} detections")

    return attempt


def _write_models(tiny: ModuleType, folder: Path) -> list[Path]:
    (folder / "labelmap.txt").write_text("cup\ntv\n")
    priors = np.array([[0.5, 0.5, 0.4, 0.4], [0.2, 0.2, 0.1, 0.1]], np.float32)
    heads = {"loc": np.zeros((1, 2, 4)), "logits": np.array([[[0, 9, 0], [9, 0, 0]]])}
    raw = tiny.save_constant_model(folder / "raw.onnx", heads, metadata=tiny.raw_metadata(priors, ["cup", "tv"]))
    boxes = tiny.tf_outputs([[0.3, 0.3, 0.7, 0.7]], [0], [0.9])
    return [raw, raw, tiny.save_constant_model(folder / "tf.onnx", boxes)]


def _lie(draw: random.Random, onnx: Any, path: Path, place: Path) -> str:
    """Change the metadata or the size of the input. What must not pass, if it is known not to."""
    model = onnx.load(path)
    metadata = {pair.key: pair.value for pair in model.metadata_props}
    what = draw.choice(("priors", "variances", "labels", "contract", "mean", "input"))
    lie = ""
    if what == "input":
        size = draw.choice((0, 1, 100_000, 30_000, 2**31, -1))
        for dimension in model.graph.input[0].type.tensor_type.shape.dim[1:3]:
            dimension.dim_value = size
    elif what == "priors":
        priors = np.array([[0.5, 0.5, 0.4, 0.4], [0.2, 0.2, 0.1, 0.1]], "<f4")
        value = priors[draw.randrange(2), draw.randrange(4)] = draw.choice(FLOATS)
        metadata["objreg.priors"] = base64.b64encode(priors.tobytes()[: draw.choice((32, 32, 32, 31, 0))]).decode()
        lie = "" if np.isfinite(value) or "tf" in path.name else f"a prior of {value}"
    else:
        metadata[f"objreg.{what}"] = _text(draw, what)
    onnx.helper.set_model_props(model, metadata)
    onnx.save(model, place)
    return lie


def _text(draw: random.Random, what: str) -> str:
    deep = "[" * DEEP
    numbers = json.dumps([draw.choice(FLOATS) for _ in range(draw.choice((0, 1, 3, 4, 4, 5)))])
    names = json.dumps(
        [draw.choice(("cup", "", "\ud800", "x" * 10_000, "???")) for _ in range(draw.choice((0, 1, 2, 3)))]
    )
    others = ("", "null", "{}", "0", '"x"', "1e400", deep, deep + "]" * DEEP, "9" * 5000, "nan", "-inf", "1e-400", "\0")
    return draw.choice((numbers, numbers, names, names, "ssd_raw/2", *others)) if what else ""


BAGS: tuple[str, ...] = ("mcap", "sqlite3", "zstd", "rosbag1", "tum")
Prepare = Callable[[Path], Attempt]
TARGETS = [
    Target("store", store_attempt, 3.0),
    *(Target(kind, partial(bag_attempt, kind), 0.8) for kind in BAGS),
    Target("model", model_attempt, 1.0),
]
