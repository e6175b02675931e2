# SPDX-License-Identifier: Apache-2.0
"""The truth beside a simulated recording: what every frame really shows, and where everything really is.

It lies in the recording's folder as ``truth/``:

``truth/frames.jsonl``, one JSON object per line. The first line describes the recording::

    {"format": "objreg-truth/1", "scenario": "loop", "seed": 1, "rate": 30.0, "frames": 600, "labels": [the nine],
     "camera": {"fx": .., "fy": .., "cx": .., "cy": .., "width": 640, "height": 480},
     "sensors": {"sensor": "structured light", "depth": {..}, "colour": {..}, "stress": {..}, "odometry": {..},
                 "rig": {"distortion": [k1, k2, p1, p2, k3], "lag_ms": .., ..}: every parameter by its name},
     "scenes": [{"objects": [{"instance": 1, "label": "book", "distractor": false, "size": [x, y, z] m,
                              "T_world_object": [16 numbers by rows], "symmetry":
                                {"axis": [x, y, z] or null, "centre": [x, y, z], "turns": [[16], ..] or null}},
                             ...]}, ...]}

and every other line one frame, in order of time::

    {"stamp_ns": .., "scene": 0, "T_world_camera": [16 numbers by rows],
     "seen": [{"instance": 1, "xyxy": [x0, y0, x1, y1] px, half open, "visibility": 0..1, "pixels": n}, ...]}

``truth/masks.zip`` holds ``<stamp_ns>.png`` for every frame: 8 bit (16 bit where a scene has more than 255 objects),
the instance number of every pixel, 0 for the room.

Poses, boxes and masks are those of the colour picture in the middle of its exposure, which is its stamp. Where a lens
bends pictures, boxes and masks are those of the rectified picture.
"""

from __future__ import annotations

import json
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.images import Intrinsics
from objreg_ros.geometry import inverse
from objreg_tools.simulation.rendering.render import Rendering
from objreg_tools.simulation.scenarios import RecordingPlan
from objreg_tools.simulation.world.model import Symmetry
from objreg_tools.simulation.world.objects import LABELS
from objreg_tools.simulation.world.scene import Placed, Scene

FOLDER, FRAMES, MASKS = "truth", "frames.jsonl", "masks.zip"
FORMAT = "objreg-truth/1"
EPOCH = (1980, 1, 1, 0, 0, 0)
"""Every file in the archive carries this time, so that the same seed gives the same bytes."""


@dataclass(frozen=True, eq=False)
class TrueObject:
    """An object of a scene: ``size (3,)`` m, ``T_world_object (4, 4)``, ``symmetry`` of its shape."""

    instance: int
    label: str
    is_distractor: bool
    size: Array
    T_world_object: Array
    symmetry: Symmetry


@dataclass(frozen=True, eq=False)
class TrueSight:
    """An object as one frame shows it: ``xyxy (4,) float32`` px, half open, and the visible share of its outline."""

    object: TrueObject
    xyxy: Array
    visibility: float
    pixels: int
    T_camera_object: Array


@dataclass(frozen=True, eq=False)
class TrueFrame:
    """One frame: time, scene, camera, and what is visible, distractors too."""

    stamp_ns: int
    scene: int
    T_world_camera: Array
    seen: tuple[TrueSight, ...]


@dataclass(frozen=True, eq=False)
class SimulationTruth:
    """The truth of a recording; ``objects`` of every scene by instance number, ``frames`` in order of time.

    ``sensors`` are the parameters it was made with, by section and name; empty in older recordings.
    """

    folder: Path
    scenario: str
    seed: int
    rate: float
    intrinsics: Intrinsics
    objects: tuple[dict[int, TrueObject], ...]
    frames: tuple[TrueFrame, ...]
    sensors: dict[str, Any]

    def frame(self, stamp_ns: int) -> TrueFrame | None:
        """The frame of exactly this time, or None."""
        return next((frame for frame in self.frames if frame.stamp_ns == stamp_ns), None)

    def mask(self, stamp_ns: int) -> Array:
        """(H, W) uint16: the instance number of every pixel; KeyError if there is no such frame."""
        with zipfile.ZipFile(self.folder / MASKS) as archive:
            png = np.frombuffer(archive.read(f"{stamp_ns}.png"), np.uint8)
        return np.asarray(cv2.imdecode(png, cv2.IMREAD_UNCHANGED), np.uint16)


def read_truth(recording: Path | str) -> SimulationTruth:
    """The truth in the folder of a simulated recording.

    FileNotFoundError where there is none, ValueError for another format.
    """
    folder = Path(recording) / FOLDER
    path = folder / FRAMES
    if not path.is_file():
        raise FileNotFoundError(f"{path}: expected the truth of a simulated recording; `objreg simulate` writes it")
    lines = path.read_text(encoding="utf-8").splitlines()
    head = json.loads(lines[0]) if lines else {}
    found = head.get("format") if isinstance(head, dict) else head
    if found != FORMAT:
        raise ValueError(f"{path}: expected format {FORMAT}, got {found!r}; simulate the recording again")
    objects = tuple({o["instance"]: _object(o) for o in scene["objects"]} for scene in head["scenes"])
    frames = tuple(_frame(json.loads(line), objects) for line in lines[1:])
    camera = Intrinsics(**head["camera"])
    made_with = head.get("sensors", {})
    return SimulationTruth(folder, head["scenario"], head["seed"], head["rate"], camera, objects, frames, made_with)


def _object(o: dict[str, Any]) -> TrueObject:
    s = o["symmetry"]
    symmetry = Symmetry(
        axis=None if s["axis"] is None else np.array(s["axis"]),
        centre=None if s["centre"] is None else np.array(s["centre"]),
        turns=None if s["turns"] is None else np.array(s["turns"]).reshape(-1, 4, 4),
    )
    T = np.array(o["T_world_object"]).reshape(4, 4)
    return TrueObject(o["instance"], o["label"], o["distractor"], np.array(o["size"]), T, symmetry)


def _frame(line: dict[str, Any], objects: tuple[dict[int, TrueObject], ...]) -> TrueFrame:
    T = np.array(line["T_world_camera"]).reshape(4, 4)
    seen = []
    for s in line["seen"]:
        o = objects[line["scene"]][s["instance"]]
        xyxy = np.array(s["xyxy"], np.float32)
        seen.append(TrueSight(o, xyxy, s["visibility"], s["pixels"], inverse(T) @ o.T_world_object))
    return TrueFrame(line["stamp_ns"], line["scene"], T, tuple(seen))


class TruthWriter:
    """Collects the truth frame by frame and writes it on `write`; small enough to be kept in memory until then."""

    def __init__(
        self,
        plan: RecordingPlan,
        scenario: str,
        seed: int,
        intrinsics: Intrinsics,
        sensors: dict[str, Any] | None = None,
    ) -> None:
        i = intrinsics
        camera = {"fx": i.fx, "fy": i.fy, "cx": i.cx, "cy": i.cy, "width": i.width, "height": i.height}
        head = {"format": FORMAT, "scenario": scenario, "seed": seed, "rate": plan.rate, "frames": len(plan)}
        scenes = [{"objects": [_describe(o) for o in scene.objects]} for scene in plan.scenes]
        of = {"labels": list(LABELS), "camera": camera, "sensors": sensors or {}, "scenes": scenes}
        self._lines = [json.dumps({**head, **of})]
        self._masks: list[tuple[str, bytes]] = []
        self._dtype = np.uint8 if max(_most(scene) for scene in plan.scenes) < 256 else np.uint16

    def write_frame(self, stamp_ns: int, scene: int, image: Rendering) -> None:
        """Take down one frame."""
        seen = [
            {"instance": o.instance, "xyxy": o.xyxy.tolist(), "visibility": round(o.visibility, 4), "pixels": o.pixels}
            for o in image.seen
        ]
        pose = image.T_world_camera.ravel().tolist()
        self._lines.append(json.dumps({"stamp_ns": stamp_ns, "scene": scene, "T_world_camera": pose, "seen": seen}))
        png = cv2.imencode(".png", image.instance.astype(self._dtype), [cv2.IMWRITE_PNG_COMPRESSION, 1])[1]
        self._masks.append((f"{stamp_ns}.png", png.tobytes()))

    def write(self, recording: Path) -> None:
        """Write ``truth/`` into the folder of the recording."""
        folder = recording / FOLDER
        folder.mkdir()
        (folder / FRAMES).write_text("\n".join(self._lines) + "\n", encoding="utf-8")
        with zipfile.ZipFile(folder / MASKS, "w", zipfile.ZIP_STORED) as archive:
            for name, png in self._masks:
                archive.writestr(zipfile.ZipInfo(name, EPOCH), png)


def _most(scene: Scene) -> int:
    return max((o.instance for o in scene.objects), default=0)


def _describe(o: Placed) -> dict[str, Any]:
    s = o.model.symmetry
    return {
        "instance": o.instance,
        "label": o.label,
        "distractor": o.is_distractor,
        "size": o.model.size.round(5).tolist(),
        "T_world_object": o.T_world_object.ravel().tolist(),
        "symmetry": {
            "axis": None if s.axis is None else s.axis.tolist(),
            "centre": None if s.centre is None else s.centre.tolist(),
            "turns": None if s.turns is None else s.turns.reshape(-1, 16).tolist(),
        },
    }
