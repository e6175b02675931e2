# SPDX-License-Identifier: Apache-2.0
"""A store as files that other programs read: PLY clouds and one JSON."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.closure_fields import fields_of
from objreg_ros.data.closure_id import closure_id
from objreg_ros.geometry import rotate, transform
from objreg_ros.memory.landmarks import Landmark, Landmarks
from objreg_ros.memory.sighting import Sighting
from objreg_ros.memory.store import Store
from objreg_ros.memory.store_file import StoreError
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registration.keyframe import Keyframe
from objreg_ros.whole_file import write_whole
from objreg_tools.report.exports.map_folder import NAMES, write_map_folder
from objreg_tools.report.exports.occupancy_grid import GridParams
from objreg_tools.report.exports.placed_keyframes import placed_in_store
from objreg_tools.report.exports.ply import write_ply
from objreg_tools.report.exports.voxel_cloud import VOXEL_M

MOST_BYTES = 200  # of a label in the name of a file, which may have 255 in all


def export(
    path: str | Path,
    folder: str | Path,
    notify: Callable[[str], None] = lambda line: None,
    grid: GridParams | None = None,
) -> Iterator[Path]:
    """Write the store at ``path`` into ``folder`` and yield each file as it is written. The store is not changed.

    ``objects/<landmark>_<label>/keyframe_<id>_<instance>.ply`` is one view of an object and
    ``contexts/keyframe_<id>.ply`` what was around it, both in m in the frame of the session. Their points are doubles,
    since that frame may be UTM's, where a float steps by half a metre. ``map.json`` holds keyframes with their objects
    (``frames`` is how many showed one, ``density`` in points per square metre of it), the landmarks that those are of,
    closures, those that a person ``vetoed``, and the ids of the keyframes that are ``damaged``: they are left out, and
    ``notify`` receives the reason. With a ``grid`` the corrected map of the store is there too, as `write_map_folder`
    writes it. StoreError (an OSError) if it is no store, OSError if there is anything in the folder already or it
    cannot be written: then nothing of the export remains.
    """
    folder = Path(folder)
    _refuse_used(folder)
    store = Store(path, read_only=True)
    try:
        with _all_or_nothing(folder):
            yield from _write(store, folder, notify)
            if grid is not None:
                placed = placed_in_store(Path(path), notify)
                yield from write_map_folder(folder, placed, grid, VOXEL_M, notify)
    finally:
        store.close()


def _write(store: Store, folder: Path, notify: Callable[[str], None]) -> Iterator[Path]:
    keyframes: list[dict[str, Any]] = []
    seen: list[Sighting] = []
    damaged: list[int] = []
    for keyframe_id in store.keyframe_ids():
        try:
            keyframe, sightings = store.keyframe(keyframe_id), list(store.sightings(keyframe_id))
        except StoreError as error:
            damaged.append(keyframe_id)
            notify(f"keyframe {keyframe_id} is left out: {error}")
            continue
        yield from _write_clouds(folder, keyframe, sightings)
        keyframes.append(_keyframe_json(keyframe, sightings))
        seen += sightings
    landmarks = [_landmark_json(known) for known in Landmarks(RegistrarParams(), seen).known()]
    closures = [fields_of(closure) for closure in store.closures()]
    vetoed = [{"id": closure_id(veto.closure), **fields_of(veto.closure)} for veto in store.vetoes()]
    content = {
        "keyframes": keyframes,
        "landmarks": landmarks,
        "closures": closures,
        "vetoed": vetoed,
        "damaged": damaged,
    }
    yield _write_json(folder / "map.json", content)


@contextmanager
def _all_or_nothing(folder: Path) -> Iterator[None]:
    """Remove what was written into a new or empty folder where the export does not come to its end."""
    was_there = folder.exists()
    try:
        yield
    except BaseException:
        for name in ("objects", "contexts"):
            shutil.rmtree(folder / name, ignore_errors=True)
        with suppress(OSError):
            for name in ("map.json", *NAMES):
                (folder / name).unlink(missing_ok=True)
            if not was_there:
                folder.rmdir()
        raise


def _refuse_used(folder: Path) -> None:
    """Files of another store must not come between those of this one."""
    if folder.is_dir() and any(folder.iterdir()):
        raise FileExistsError(
            f"{folder}: expected a new or empty folder, got one that holds something; choose another or empty it"
        )


def _write_clouds(folder: Path, keyframe: Keyframe, sightings: list[Sighting]) -> Iterator[Path]:
    T = np.eye(4) if keyframe.T_odom_camera is None else keyframe.T_odom_camera
    name = f"keyframe_{keyframe.keyframe_id:06d}"
    for item, sighting in zip(keyframe.objects, sightings, strict=True):
        place = folder / "objects" / f"{sighting.landmark:05d}_{_file_name(item.label)}"
        yield _write_cloud(
            place / f"{name}_{sighting.instance:03d}.ply", T, item.cloud.xyz, item.cloud.normals, item.cloud.rgb
        )
    context = keyframe.context
    yield _write_cloud(folder / "contexts" / f"{name}.ply", T, context.xyz, context.normals)


def _write_cloud(path: Path, T_session_camera: Array, xyz: Array, normals: Array, rgb: Array | None = None) -> Path:
    """Points and normals of the camera, written in the session's frame."""
    return write_ply(path, transform(T_session_camera, xyz.astype(float)), rotate(T_session_camera, normals), rgb)


def _keyframe_json(keyframe: Keyframe, sightings: list[Sighting]) -> dict[str, Any]:
    return {
        "id": keyframe.keyframe_id,
        "session": keyframe.session,
        "stamp_ns": keyframe.stamp_ns,
        "frame_id": keyframe.frame_id,
        "T_session_camera": None if keyframe.T_odom_camera is None else keyframe.T_odom_camera.tolist(),
        "by_odometry": keyframe.by_odometry,
        "gravity": None if keyframe.gravity is None else keyframe.gravity.tolist(),
        "objects": [
            {
                "landmark": sighting.landmark,
                "instance": sighting.instance,
                "label": sighting.label,
                "score": sighting.score,
                "position": sighting.position.tolist(),
                "points": len(item.cloud),
                "frames": item.sightings,
                "density": item.cloud.density,
            }
            for item, sighting in zip(keyframe.objects, sightings, strict=True)
        ],
    }


def _landmark_json(known: Landmark) -> dict[str, Any]:
    """``position`` is in the frame of the ``session`` that saw the landmark last, at ``stamp_ns``."""
    return {
        "landmark": known.landmark,
        "label": known.label,
        "session": known.session,
        "stamp_ns": known.stamp_ns,
        "position": known.position.tolist(),
        "sightings": known.sightings,
    }


def _write_json(path: Path, content: dict[str, Any]) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    write_whole(path, json.dumps(content, indent=1) + "\n")
    return path


def _file_name(label: str) -> str:
    """The label with letters and digits only, cut where it is too long for a name."""
    name = "".join(letter if letter.isalnum() else "_" for letter in label)
    return name.encode()[:MOST_BYTES].decode(errors="ignore")
