# SPDX-License-Identifier: Apache-2.0
"""What the store costs at 10^2 to 10^6 objects: a frame, inserting, querying, size on disk, memory; and kill -9.

    python benchmarks/store.py --json OUT [--quick] [--sizes 100,100000] [--kills N]

``sizes``: for each number of stored objects ``insert_ms`` (one keyframe, on the disk), ``query_ms`` (one object against
the index), ``keyframe_query_ms`` (all objects of a keyframe), each with p50 and p95, ``memory_mb`` of all that a
registrar holds of the store, ``open_s`` until it holds that, and ``disk_mb`` (none from 10^5 on, where the stored
objects are light to spare the disk). ``kills``: how often a writing process
was killed at a random moment, how many keyframes it had acknowledged, how many of those were lost. The content is made
up, of the size that a Kinect gives; all objects are of one of nine labels, and all in reach by odometry. ``frames``:
what a frame costs the registrar, everything included, beside so many light objects of other places (`frame_cost`), as
far as it keeps so many, and
``frame_ratio`` that of the most to the fewest.
"""

from __future__ import annotations

import json
import os
import random
import signal
import tempfile
import time
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any, TextIO

import click
import numpy as np
from command_line import quick_values
from frame_cost import frame_costs, table_frames
from tqdm import tqdm

from objreg_ros.data.frames import ObjectCloud, View
from objreg_ros.data.images import Intrinsics
from objreg_ros.memory.checksum import sealed
from objreg_ros.memory.counters import Counters
from objreg_ros.memory.descriptor import SIZE
from objreg_ros.memory.landmarks import Landmarks
from objreg_ros.memory.migration import insert
from objreg_ros.memory.retrieval import Index
from objreg_ros.memory.sighting import Sighting, sightings_of
from objreg_ros.memory.store import Store
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registration.keyframe import Context, Keyframe, KeyObject

CAMERA = Intrinsics(fx=131.25, fy=131.25, cx=79.625, cy=59.625, width=160, height=120)
LABELS = ("cup", "book", "chair", "tv", "keyboard", "bottle", "bowl", "mouse", "laptop")
PER_KEYFRAME = 8
SIZES = (100, 1_000, 10_000, 100_000, 1_000_000)
HEAVY = 10_000  # the most objects of full size: more would fill the disk
PARTS = ("sizes", "frames", "kills")
SAMPLES = 60
QUICK_KILLS = 10
POINTS = 1500  # of an object
LIGHT = 30  # of an object beyond that
VIEWS = 8  # keyframes that a landmark is seen in


def make_keyframe(number: int, draw: np.random.Generator, points: int = POINTS) -> Keyframe:
    """A keyframe of made-up objects, a context of four times their points and a noisy view."""
    objects = tuple(_make_object(i + 1, draw, points) for i in range(PER_KEYFRAME))
    camera = CAMERA if points == POINTS else CAMERA.scaled(10)
    noise = draw.normal(size=(camera.height, camera.width))
    depth = (2.0 + 0.01 * noise).astype(np.float32)
    v, u = np.mgrid[0 : camera.height, 0 : camera.width].astype(np.float32)
    xyz = np.stack([(u - camera.cx) / camera.fx * depth, (v - camera.cy) / camera.fy * depth, depth], axis=-1)
    context = draw.normal(size=(4 * points, 3)).astype(np.float32)
    return Keyframe(
        keyframe_id=number,
        session=0,
        stamp_ns=number * 10**9,
        frame_id="camera",
        objects=objects,
        context=Context(xyz=context, normals=context / np.linalg.norm(context, axis=1, keepdims=True)),
        view=View(xyz=xyz, grey=np.asarray(128 + 20 * noise, np.uint8), intrinsics=camera),
        gravity=np.array([0.0, 1.0, 0.0]),
        gravity_confidence=1.0,
        T_odom_camera=np.eye(4),
    )


def write_forever(path: str, seed: int) -> None:
    """Add keyframes and say the id of each that is written, until killed."""
    draw, store = np.random.default_rng(seed), Store(path)
    pattern = make_keyframe(0, draw)
    while True:
        keyframe = replace(pattern, keyframe_id=store.next_keyframe())
        store.write_keyframe(keyframe, sightings_of(keyframe))
        os.write(1, f"{keyframe.keyframe_id}\n".encode())


def measure_size(objects: int, folder: Path) -> dict[str, Any]:
    """The costs at one number of stored objects."""
    path, draw = folder / f"{objects}.db", np.random.default_rng(0)
    _fill(path, objects, draw, POINTS if objects <= HEAVY else LIGHT)
    disk = path.stat().st_size / 1e6 if objects <= HEAVY else None
    before, began = _resident_mb(), time.perf_counter()
    with closing(Store(path)) as store:
        index, landmarks = _remembered(store)
        opened, memory = time.perf_counter() - began, _resident_mb() - before
        asked = [sightings_of(make_keyframe(10**6 + i, draw)) for i in range(SAMPLES)]
        single = [_ms(index.query, [row]) for rows in asked for row in rows[:4]]
        whole = [_ms(index.query, rows) for rows in asked]
        keyframes = [make_keyframe(store.next_keyframe() + i, draw) for i in range(SAMPLES // 3)]
        insert = [_ms(store.write_keyframe, keyframe, sightings_of(keyframe)) for keyframe in keyframes]
    path.unlink()
    return {
        "insert_ms": _percentiles(insert),
        "query_ms": _percentiles(single),
        "keyframe_query_ms": _percentiles(whole),
        "open_s": opened,
        "disk_mb": disk,
        "memory_mb": memory,
        "landmarks": len(landmarks),
    }


def _remembered(store: Store) -> tuple[Index, Landmarks]:
    """What a registrar holds in memory beside the heads of the keyframes."""
    index, landmarks = Index(RegistrarParams(min_gap=0.0)), Landmarks(RegistrarParams(), first=store.next_landmark())
    index.add_objects(landmarks.passing(store.sightings()))
    return index, landmarks


def measure_kills(kills: int, folder: Path) -> dict[str, int]:
    """Kill writing processes at random moments; every id that they said must be there, whole, afterwards."""
    path, draw = folder / "killed.db", random.Random(0)
    acknowledged: set[int] = set()
    lost: set[int] = set()
    for k in tqdm(range(kills), desc="kill -9"):
        writer, said = _fork_writer(path, k)
        first = said.readline()
        time.sleep(draw.uniform(0.0, 0.08))
        os.kill(writer, signal.SIGKILL)
        acknowledged |= {int(line) for line in (first + said.read()).split("\n")[:-1]}
        os.waitpid(writer, 0)
        said.close()
        if k % 20 == 19 or k == kills - 1:
            lost |= _lost(path, acknowledged)
    return {"kills": kills, "acknowledged_keyframes": len(acknowledged), "lost": len(lost)}


def _fork_writer(path: Path, seed: int) -> tuple[int, TextIO]:
    """A process that writes until it is killed, and what it says."""
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        os.dup2(writer, 1)
        write_forever(str(path), seed)
    os.close(writer)
    return child, os.fdopen(reader)


def _lost(path: Path, acknowledged: set[int]) -> set[int]:
    with closing(Store(path)) as store:
        there = set(store.keyframe_ids())
        whole = {number for number in acknowledged & there if len(store.keyframe(number).objects) == PER_KEYFRAME}
    return acknowledged - whole


def measure_frames(sizes: Sequence[int], folder: Path) -> dict[str, Any]:
    """What a frame costs beside so many stored objects."""
    frames, stores = table_frames(folder), [folder / f"frames_{objects}.db" for objects in sizes]
    for store, objects in zip(stores, sizes, strict=True):
        _fill(store, objects, np.random.default_rng(1), LIGHT)
    costs = frame_costs(stores, frames)
    ratio = costs[-1]["frame_ms"] / costs[0]["frame_ms"]
    return {"frames": dict(zip(map(str, sizes), costs, strict=True)), "frame_ratio": ratio}


def _fill(path: Path, objects: int, draw: np.random.Generator, points: int) -> None:
    """A store of that many objects: up to 32 made keyframes, then copies of their rows with other descriptors."""
    keyframes, made = objects // PER_KEYFRAME, min(32, objects // PER_KEYFRAME)
    with closing(Store(path)) as store:
        for number in range(1, made + 1):
            keyframe = make_keyframe(number, draw, points)
            store.write_keyframe(keyframe, [_landmark(s, i) for i, s in enumerate(sightings_of(keyframe))])
        for shift in range(made, keyframes, made):
            with store._changing() as (transaction, counters):
                _copy_keyframes(transaction, counters, shift, made)
                _copy_objects(transaction, counters, shift, made, draw)


def _copy_keyframes(transaction: Any, counters: Counters, shift: int, made: int) -> None:
    for found in transaction.execute("SELECT * FROM keyframe WHERE id <= ?", (made,)).fetchall():
        moment = {"id": found["id"] + shift, "stamp_ns": found["stamp_ns"] + shift * 10**9}
        insert(transaction, "keyframe", sealed("keyframe", {**found, **moment}))
        _copy_beside(transaction, "scene", found["id"], moment["id"])
        counters.enter("keyframe", moment["id"])


def _copy_objects(transaction: Any, counters: Counters, shift: int, made: int, draw: np.random.Generator) -> None:
    rows = [dict(row) for row in transaction.execute("SELECT * FROM object WHERE keyframe <= ?", (made,))]
    for row in rows:
        descriptor = np.frombuffer(row["descriptor"], np.float32) + draw.normal(0, 0.3, SIZE).astype(np.float32)
        landmark = row["landmark"] + shift // VIEWS * PER_KEYFRAME
        row.update(keyframe=row["keyframe"] + shift, landmark=landmark, descriptor=descriptor.tobytes())
        number = counters.next("object")
        insert(transaction, "object", sealed("object", {**row, "id": number}))
        _copy_beside(transaction, "cloud", row["id"], number)
        counters.enter("object", number)


def _copy_beside(transaction: Any, table: str, number: int, copy: int) -> None:
    found = transaction.execute(f"SELECT * FROM {table} WHERE id = ?", (number,)).fetchone()
    insert(transaction, table, sealed(table, {**found, "id": copy}))


def _landmark(sighting: Sighting, number: int) -> Sighting:
    """Its landmark: the objects of so many keyframes in a row are the same."""
    return sighting.of_landmark((sighting.keyframe_id - 1) // VIEWS * PER_KEYFRAME + number + 1, np.eye(3))


def _make_object(instance: int, draw: np.random.Generator, points: int) -> KeyObject:
    xyz = (draw.random((points, 3)) * draw.uniform(0.05, 0.5, 3)).astype(np.float32)
    cloud = ObjectCloud(
        label=LABELS[draw.integers(len(LABELS))],
        score=0.8,
        instance=instance,
        xyz=xyz,
        normals=xyz,
        rgb=draw.integers(0, 255, (points, 3), np.uint8),
        flags=np.zeros(points, np.uint16),
        density=1e5,
    )
    return KeyObject(cloud=cloud)


def _ms(call: Callable[..., Any], *arguments: Any) -> float:
    began = time.perf_counter()
    call(*arguments)
    return 1e3 * (time.perf_counter() - began)


def _percentiles(values: list[float]) -> dict[str, float]:
    return {"p50": float(np.percentile(values, 50)), "p95": float(np.percentile(values, 95))}


def _resident_mb() -> float:
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6


def _parts(_: click.Context, __: click.Parameter, text: str) -> tuple[str, ...]:
    parts = tuple(text.split(","))
    if set(parts) - set(PARTS):
        raise click.BadParameter(f"expected some of {','.join(PARTS)}, got {text!r}")
    return parts


def _sizes(_: click.Context, __: click.Parameter, text: str) -> tuple[int, ...]:
    try:
        sizes = tuple(map(int, text.split(",")))
    except ValueError:
        sizes = ()
    if not sizes or min(sizes) < PER_KEYFRAME:
        raise click.BadParameter(f"expected numbers of objects from {PER_KEYFRAME} on, got {text!r}")
    return sizes


@click.command(help=__doc__)
@click.option("--json", "out", type=click.Path(dir_okay=False, path_type=Path), help="Write the figures here.")
@click.option("--quick", is_flag=True, help="Up to 10^4 objects and fewer kills.")
@click.option("--sizes", default=",".join(map(str, SIZES)), show_default=True, callback=_sizes, help="Stored objects.")
@click.option("--kills", type=click.IntRange(min=0), default=200, show_default=True)
@click.option("--parts", default=",".join(PARTS), show_default=True, callback=_parts, help="What is measured.")
@click.pass_context
def main(
    context: click.Context, out: Path | None, quick: bool, sizes: tuple[int, ...], kills: int, parts: tuple[str, ...]
) -> None:
    """Measure and print."""
    fewer = quick_values(context, quick, {"kills": QUICK_KILLS, "sizes": SIZES[:3]})
    kills, sizes = fewer.get("kills", kills), fewer.get("sizes", sizes)
    figures: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if "sizes" in parts:
            figures["sizes"] = {str(n): measure_size(n, folder) for n in tqdm(sizes, desc="sizes")}
        few = [n for n in sizes if n <= PER_KEYFRAME * RegistrarParams().max_keyframes]
        if "frames" in parts and few:
            figures |= measure_frames(few, folder)
        if "kills" in parts:
            figures["kills"] = measure_kills(kills, folder)
    print(json.dumps(figures, indent=1))
    if out is not None:
        out.write_text(json.dumps(figures, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
