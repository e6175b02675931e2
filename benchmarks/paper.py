# SPDX-License-Identifier: Apache-2.0
"""The founding document's two tables again: its error, the founding method here, and ours, with the true pose error.

An object stands on a table (a chair on the floor) in a simulated room; the camera goes around it by the angle X, up by
Y and rolls by Z. The error is the document's: the mean distance in metres between closest points after alignment. It
says little of the pose, so the true error of the object's pose stands beside it (up to the object's symmetry).

Ours is the registration of the object's shape; its time is that of a pair, and what is made once of every keyframe
stands beside it, as `prepare_ms`. What the whole engine makes of the pair, and its gate, is `engine`.

    python benchmarks/paper.py --json paper.json --figure paper.svg
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click
import numpy as np
from command_line import quick_values
from pose_figures import SUCCESS
from scipy.spatial import cKDTree
from sources import SIMULATED

from objreg_ros.data.checked import Array
from objreg_ros.data.frames import Frame
from objreg_ros.data.images import DepthImage, Detections
from objreg_ros.geometry import inverse, pose, rotation_from_vector, transform
from objreg_ros.keyframes.frame_window import FrameWindow
from objreg_ros.keyframes.fusion import fuse
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registration.candidate import Candidate
from objreg_ros.registration.engine import Engine
from objreg_ros.registration.gate.verdict import judge
from objreg_ros.registration.keyframe import Keyframe
from objreg_ros.registration.paper import register
from objreg_ros.registration.prepare.prepared import Prepared, prepare
from objreg_ros.registration.propose.object_poses import from_shapes
from objreg_ros.segmenter.params import SegmenterParams
from objreg_ros.segmenter.segment import Segmenter
from objreg_tools.simulation.rendering.light import looking
from objreg_tools.simulation.rendering.render import Rendering, render
from objreg_tools.simulation.world import furniture
from objreg_tools.simulation.world.model import ObjectModel
from objreg_tools.simulation.world.objects import make_object
from objreg_tools.simulation.world.scene import Scene, furnished, number, place_on
from objreg_tools.truth import within

ASIDE = 0.18  # m from the middle of the table, about which half a turn would look the same
PAPER_SECONDS = (2.0, 4.0)  # what the document says of its time for a pair
METHODS = ("founding", "ours", "engine")
BINS = ((0, 30), (30, 60), (60, 120), (120, 181))
UP = np.array([0.0, 0.0, 1.0])
Angles = tuple[float, float, float]

# What the document reports: (X, Y, Z in degrees, error in metres).
TABLE_1: dict[str, tuple[Angles, float]] = {
    "cap": ((30, 10, 2), 0.0000445),
    "cereal_box": ((192, -3, 0), 0.00056),
    "soda_can": ((55, 0, 0), 0.2563),
    "chair": ((15, 6, 0), 0.0000236),
    "monitor": ((140, 48, 6), 0.000178),
    "bowl": ((39, 15, 5), 0.0945),
    "flashlight": ((23, 2, -5), 0.3586),
    "book": ((63, -12, 0), 0.000423),
    "keyboard": ((36, -5, -3), 0.00628),
}
SWEEP = (-180, -150, -120, -90, -60, -30, 30, 60, 90, 120, 150, 180)
TABLE_2: dict[str, tuple[float, ...]] = {
    "cap": (0.000963, 0.0006548, 0.003645, 0.066, 0.0008745, 0.00036, 0.00036, 0.009542, 0.0916, 0.00123, 0.000621,
            0.0001126),
    "cereal_box": (0.0002, 0.000895, 0.00982, 0.088, 0.005489, 0.0005511, 0.0005511, 0.002693, 0.0841, 0.00236,
                   0.00048, 0.000151),
    "soda_can": (0.0323, 0.0651, 0.0459741, 0.025, 0.0216, 0.0519, 0.0384, 0.0231, 0.0356, 0.00489, 0.0415, 0.03263),
    "chair": (0.000165, 0.003, 0.00917, 0.0989, 0.005654, 0.00111, 0.00111, 0.008843, 0.0684, 0.00951, 0.00216,
              0.000127),
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Stage:
    """A room with one object in it, and how it is looked at."""

    scene: Scene
    model: ObjectModel
    T_world_object: Array
    start_deg: float
    distance: float

    @classmethod
    def of(cls, label: str, seed: int, aside: float = 0.0) -> Stage:
        """A stage by label and seed; the object stands ``aside`` m from the middle of the table, twice that in a room.

        In the very middle of a table, half a turn about the object is half a turn of the table: both look the same.
        """
        rng = np.random.default_rng([seed, list(TABLE_1).index(label)])
        model = make_object(label, int(rng.integers(2**31)))
        table, room = furniture.table(rng, (1.3, 0.8)), furniture.room(rng, (2.6, 2.6))
        scene = furnished(rng, [] if model.on_floor else [(table, np.eye(4))], room)
        x, y, height = (0.0, 0.0, 0.0) if model.on_floor else table.boards[0][:3]
        if aside > 0.0:
            way, far = rng.uniform(0.0, 2.0 * np.pi), aside * (2.0 if model.on_floor else 1.0)
            x, y = x + far * np.cos(way), y + far * np.sin(way)
        T = place_on(model, pose(np.eye(3), np.array([0.0, 0.0, height])), x, y, float(rng.uniform(0, 2 * np.pi)))
        distance = float(rng.uniform(1.2, 1.45) if model.on_floor else rng.uniform(0.7, 1.0))
        return cls(scene.with_objects(number([(model, T)])), model, T, float(rng.uniform(0, 360)), distance)

    def camera(self, angles: Angles, rng: np.random.Generator) -> Array:
        """``T_world_camera`` after the camera went around by X, up by Y and rolled by Z.

        No hand keeps the distance or the aim: both differ a little from view to view.
        """
        azimuth, elevation = np.radians(self.start_deg + angles[0]), np.radians(35.0 + angles[1])
        away = np.array([np.cos(azimuth) * np.cos(elevation), np.sin(azimuth) * np.cos(elevation), np.sin(elevation)])
        centre = transform(self.T_world_object, self.model.mesh.bounds.mean(axis=0).astype(float))
        distance, aim = self.distance * rng.uniform(0.9, 1.1), centre + rng.normal(0.0, 0.03, 3)
        roll = pose(rotation_from_vector(np.array([0.0, 0.0, np.radians(angles[2])])), np.zeros(3))
        return looking(centre + distance * away, aim, UP) @ roll

    def error(self, T_first_second: Array, T_world_first: Array, T_world_second: Array) -> tuple[float, float]:
        """(degrees, centimetres) of the object's pose in the first camera when it is carried over from the second."""
        carried = T_first_second @ inverse(T_world_second) @ self.T_world_object
        return self.model.symmetry.pose_error(carried, inverse(T_world_first) @ self.T_world_object)


def shoot(stage: Stage, T_world_camera: Array, seed: int, preset: str) -> Frame:
    """What the segmenter makes of one picture, with the true box of the object."""
    picture: Rendering = render(stage.scene, T_world_camera, seed=seed)
    image = DepthImage(depth=picture.depth, rgb=picture.rgb, intrinsics=picture.intrinsics, stamp_ns=seed)
    boxes = np.array([seen.xyxy for seen in picture.objects], np.float32).reshape(-1, 4)
    seen = Detections(
        xyxy=boxes,
        score=np.ones(len(boxes), np.float32),
        label=(stage.model.label,) * len(boxes),
        image_hw=picture.depth.shape,
        stamp_ns=seed,
    )
    return Segmenter(SegmenterParams(preset=preset)).segment(seen, image)


def keyframe(frame: Frame, params: RegistrarParams) -> Keyframe:
    """A keyframe of a single frame."""
    return fuse(FrameWindow.of(frame), params)


def closest(source: Array, target: Array, T_target_source: Array) -> float:
    """The document's error: the mean distance in m of moved points to their closest."""
    return float(cKDTree(target).query(transform(T_target_source, source.astype(float)))[0].mean())


def founding(first: Frame, second: Frame, params: RegistrarParams) -> tuple[Array, float] | None:
    """Point-to-point ICP of the object's two clouds from where they are: its pose and its error; None without one."""
    if not first.objects or not second.objects:
        return None
    target, source = first.objects[0].xyz, second.objects[0].xyz
    alignment = register(source, target, np.eye(4))
    if alignment is None:
        return None
    return alignment.T_target_source, closest(source, target, alignment.T_target_source)


def ours(source: Prepared, target: Prepared) -> Array | None:
    """The best pose ``T_target_source`` of the object by its shape; None without one."""
    found = from_shapes(source, target)
    return found[0].T_target_source if found else None


def whole(first: Keyframe, second: Keyframe, engine: Engine) -> tuple[Array, bool] | None:
    """The engine's best pose of the pair, and whether the gate accepts it; None without a pose."""
    candidates = engine.propose(second, first)
    verdict = judge(candidates)
    if isinstance(verdict, Candidate):
        return verdict.T_target_source, True
    return (candidates[0].T_target_source, False) if candidates else None


def ready(key: Keyframe, params: RegistrarParams) -> Prepared:
    """The keyframe as registrations use it, with what they would make of it at first use."""
    prepared = prepare(key, params)
    for shape in (*prepared.shapes, prepared.scene):
        if shape is not None:
            shape.surface, shape.kernel_arrays  # noqa: B018
    return prepared


def timed(work: Callable[[], Any]) -> tuple[Any, dict[str, float]]:
    """What the work gives, and its milliseconds on the clock and of the processor."""
    start, cpu = time.perf_counter(), time.process_time()
    result = work()
    return result, {"ms": 1e3 * (time.perf_counter() - start), "cpu_ms": 1e3 * (time.process_time() - cpu)}


class Bench:
    """Registers cells of the tables; every cell is the median over its seeds."""

    def __init__(self, seeds: Sequence[int]) -> None:
        self.params = RegistrarParams().replaced(**SIMULATED)
        self.engine = Engine(self.params)
        self._seeds = seeds
        self._stages = {(label, seed): Stage.of(label, seed, ASIDE) for label in TABLE_1 for seed in seeds}
        self.pairs: list[dict[str, Any]] = []

    def cell(self, label: str, angles: Angles, document: float | None) -> dict[str, Any]:
        """One cell: the document's error, and of every method the error, the true error and how often it was right."""
        rows = [self._pair(label, angles, seed) for seed in self._seeds]
        self.pairs += rows
        methods = {name: summed([row[name] for row in rows]) for name in METHODS}
        return {"object": label, "angles_deg": list(angles), "document_m": document, **methods}

    def _pair(self, label: str, angles: Angles, seed: int) -> dict[str, Any]:
        stage = self._stages[label, seed]
        rng = np.random.default_rng([seed, int(angles[0]) + 360])
        cameras = stage.camera((0.0, 0.0, 0.0), rng), stage.camera(angles, rng)
        noise = rng.integers(2**31, size=2).tolist()
        paper, full = (
            [shoot(stage, T, s, preset) for T, s in zip(cameras, noise, strict=True)] for preset in ("paper", "default")
        )
        keys = [keyframe(frame, self.params) for frame in full]
        made, preparing = timed(lambda: [ready(key, self.params) for key in keys])
        row: dict[str, Any] = {"angle": abs(((angles[0] + 180) % 360) - 180)}
        answer, spent = timed(lambda: founding(paper[0], paper[1], self.params))
        row["founding"] = {**self._judged(stage, answer, cameras), **spent}
        T, spent = timed(lambda: ours(made[1], made[0]))
        found = None if T is None or not all(f.objects for f in full) else (T, self._error(full, T))
        row["ours"] = {**self._judged(stage, found, cameras), **spent, "prepare_ms": preparing["cpu_ms"] / 2}
        answer, spent = timed(lambda: whole(keys[0], keys[1], self.engine))
        accepted = answer is not None and answer[1]
        found = None if answer is None else (answer[0], self._error(full, answer[0]))
        row["engine"] = {**self._judged(stage, found, cameras), **spent, "accepted": accepted}
        return row

    @staticmethod
    def _error(frames: Sequence[Frame], T_first_second: Array) -> float | None:
        """The document's error; None where a view shows no object."""
        first, second = frames
        if not first.objects or not second.objects:
            return None
        return closest(second.objects[0].xyz, first.objects[0].xyz, T_first_second)

    @staticmethod
    def _judged(stage: Stage, answer: Any, cameras: tuple[Array, Array]) -> dict[str, Any]:
        if answer is None:
            return {"error_m": None, "rotation_deg": None, "translation_cm": None, "success": False}
        T, error = answer
        degrees, centimetres = stage.error(T, *cameras)
        right = within((degrees, centimetres), SUCCESS)
        return {"error_m": error, "rotation_deg": degrees, "translation_cm": centimetres, "success": right}


def summed(rows: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Medians over the seeds that gave an answer, and the share that was right."""
    out: dict[str, Any] = {"success": float(np.mean([row["success"] for row in rows]))}
    for key in ("error_m", "rotation_deg", "translation_cm", "ms", "cpu_ms"):
        values = [row[key] for row in rows if row[key] is not None]
        out[key] = float(np.median(values)) if values else None
    if "accepted" in rows[0]:
        out["accepted"] = float(np.mean([row.get("accepted", False) for row in rows]))
    return out


def by_angle(pairs: Sequence[dict[str, Any]]) -> dict[str, dict[str, float]]:
    """View change in degrees → the share of pairs that each method got right, and how many there were."""
    out = {}
    for low, high in BINS:
        rows = [row for row in pairs if low <= row["angle"] < high]
        if rows:
            shares = {name: float(np.mean([row[name]["success"] for row in rows])) for name in METHODS}
            out[f"{low}-{min(high, 180)}"] = {"pairs": float(len(rows)), **shares}
    return out


def speed(pairs: Sequence[dict[str, Any]]) -> dict[str, float]:
    """Median milliseconds a pair, segmentation and preparation apart, and how many times the document's 2 s is as long.

    The processor's time is what the pair takes on a machine that does nothing else.
    """
    out = {
        f"{name}_{kind}": float(np.median([row[name][kind] for row in pairs]))
        for name in METHODS
        for kind in ("ms", "cpu_ms")
    }
    out["ours_prepare_ms"] = float(np.median([row["ours"]["prepare_ms"] for row in pairs]))
    paper_ms = 1e3 * PAPER_SECONDS[0]
    ratios = {"ratio_paper_ms": paper_ms / out["ours_ms"], "ratio_paper_cpu_ms": paper_ms / out["ours_cpu_ms"]}
    return {**out, "paper_ms": paper_ms, **ratios}


def line_graph(sweep: dict[str, list[dict[str, Any]]], file: Path) -> None:
    """The document's figure 10: error against angle, one panel an object, with the true error below."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(
        2, len(sweep), figsize=(3.4 * len(sweep), 5.6), sharex=True, sharey="row", squeeze=False
    )
    styles = {"founding": ("#d95926", "founding method here"), "ours": ("#2a78d6", "ours")}
    for column, (label, cells) in enumerate(sweep.items()):
        angles = [cell["angles_deg"][0] for cell in cells]
        top, bottom = axes[:, column]
        stated = [(a, cell["document_m"]) for a, cell in zip(angles, cells, strict=True) if cell["document_m"]]
        top.semilogy(*zip(*stated, strict=True), "--", color="#8b8a83", label="the document")
        for name, (colour, title) in styles.items():
            top.semilogy(angles, [cell[name]["error_m"] for cell in cells], color=colour, label=title)
            bottom.plot(angles, [cell[name]["rotation_deg"] for cell in cells], color=colour, label=title)
        top.minorticks_off()
        top.set_title(label.replace("_", " "))
        bottom.set_xlabel("change of view about X, °")
        bottom.set_xticks(range(-180, 181, 90))
    axes[0, 0].set_ylabel("closest-point error, m")
    axes[1, 0].set_ylabel("true rotation error, °")
    axes[0, -1].legend(fontsize=8)
    figure.tight_layout()
    with pyplot.rc_context({"svg.fonttype": "none"}):  # text, not outlines of letters
        figure.savefig(file)


def show(cell: dict[str, Any]) -> str:
    """One cell as a line."""
    line = f"{cell['object']:11} {cell['angles_deg'][0]:5.0f}°"
    line += "        " if cell["document_m"] is None else f"  {cell['document_m']:.5f} m"
    for name in METHODS:
        m = cell[name]
        none = m["error_m"] is None
        line += f"  {name}: " + ("none" if none else f"{m['error_m']:.4f} m {m['rotation_deg']:5.1f}° "
                                  f"{m['translation_cm']:5.1f} cm {100 * m['success']:3.0f} %")  # fmt: skip
        line += f", accepted {100 * m['accepted']:.0f} %" if "accepted" in m else ""
    return line


@click.command()
@click.option("--seeds", default=3, show_default=True, help="Instances of every object.")
@click.option("--seed", default=0, show_default=True, help="The first seed.")
@click.option("--step", type=click.Choice(["10", "30"]), default="30", show_default=True, help="Degrees of the sweep.")
@click.option("--json", "json_file", type=click.Path(dir_okay=False, path_type=Path), help="Write the figures here.")
@click.option("--figure", type=click.Path(dir_okay=False, path_type=Path), help="Draw the line graph here (svg, png).")
@click.option("--quick", is_flag=True, help="One instance, and only table 1 and one object of table 2.")
@click.pass_context
def main(
    context: click.Context, seeds: int, seed: int, step: str, json_file: Path | None, figure: Path | None, quick: bool
) -> None:
    """Reproduce the founding document's tables in simulation."""
    bench = Bench(range(seed, seed + quick_values(context, quick, {"seeds": 1}).get("seeds", seeds)))
    bench.cell("book", (0.0, 0.0, 0.0), 0.0)  # compiles what has to be compiled
    bench.pairs.clear()
    table = []
    for label, (angles, document) in TABLE_1.items():
        table.append(bench.cell(label, angles, document))
        click.echo(show(table[-1]))
    sweep: dict[str, list[dict[str, Any]]] = {}
    for label, errors in list(TABLE_2.items())[: 1 if quick else None]:
        known = dict(zip(SWEEP, errors, strict=True))
        sweep[label] = []
        for angle in range(-180, 181, int(step)):
            if angle == 0:
                continue
            sweep[label].append(bench.cell(label, (float(angle), 0.0, 0.0), known.get(angle)))
            click.echo(show(sweep[label][-1]))
    result = {"table_1": table, "table_2": sweep, "by_angle": by_angle(bench.pairs), "time": speed(bench.pairs)}
    click.echo(json.dumps({"by_angle": result["by_angle"], "time": result["time"]}, indent=1))
    if json_file is not None:
        json_file.write_text(json.dumps(result, indent=1))
    if figure is not None:
        line_graph(sweep, figure)


if __name__ == "__main__":
    main()
