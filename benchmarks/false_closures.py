# SPDX-License-Identifier: Apache-2.0
"""How often an accepted pose is false, where every keyframe is held against many.

Online a keyframe tries the four likeliest places and is content with two closures. Here it tries ten and is content
with none, and closures need not be far from each other, so that the gate judges some hundreds of pairs of keyframes in
every recording. What it accepts is judged by truth, and apart where one object alone speaks for it; of what it refuses
it is said how often the best pose that was proposed was loosely right, and why it was refused.

    python benchmarks/false_closures.py --json OUT
    python benchmarks/false_closures.py --first-seed 2100 --recordings 25 --keep FOLDER   fresh; goes on where it was
    python benchmarks/false_closures.py --simulate look-alikes:82 --simulate moved:103:qvga:stress
    python benchmarks/false_closures.py --simulate moved:704:realsense_d435 --model truth
    python benchmarks/false_closures.py --simulate loop:9:sensor=realsense_d435:lens=webcam:lag_ms=25:blur_ms=10

A camera by name changes the view only. ``sensor=`` takes its depth sensor and its camera. The other settings are the
options of `objreg simulate` of the same name.
"""

from __future__ import annotations

import json
import tempfile
from collections import Counter
from collections.abc import Sequence
from functools import partial
from itertools import cycle
from pathlib import Path
from typing import Any, NamedTuple

import click
from sources import detector_of, read_source

from objreg_ros.data.closures import UNTRIED, LoopClosure, Rejected
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registrar.registrar import Registrar
from objreg_ros.whole_file import write_whole
from objreg_tools.cli.commands.simulate import camera_of, distortion_of, sensors_of
from objreg_tools.simulation.scenarios import SCENARIOS
from objreg_tools.simulation.sensors.camera import CAMERAS, SENSORS
from objreg_tools.simulation.write import simulate
from objreg_tools.truth import LOOSE, Truth, summarise, within
from objreg_tools.workers import spread

EAGER = {"candidates": 10, "closures": 10, "thin_seconds": 0.2, "threads": 1}
PLANS = (
    "look-alikes:82",
    "moved:103:stress",
    "opposite:121:stress",
    "moved:122:qvga:stress",
    "loop:123:realsense_d435",
    "look-alikes:124:stress",
    "moved:125",
    "opposite:126:azure_kinect",
    "loop:127:qvga:stress",
    "moved:128:realsense_d435:stress",
)
FRESH = ("look-alikes", "moved", "opposite", "loop")
SEEN_BY = ("kinect", "qvga", "sensor=realsense_d435", "sensor=azure_kinect")
HEAD = f"{'recording':32} {'tried':>6} {'accepted':>9} {'strict':>7} {'loose':>6} {'false':>6}  refused, though right"


class Plan(NamedTuple):
    """What is simulated."""

    scenario: str
    seed: int
    camera: str
    stress: bool
    sensor: str = "kinect_v1"
    rig: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """As tables have it."""
        sensor = [] if self.sensor == "kinect_v1" else [f"{self.sensor} depth"]
        rig = [setting.removeprefix("rig.") for setting in self.rig]
        return ", ".join([f"{self.scenario} {self.seed}", self.camera, *sensor, *rig, *["stress"] * self.stress])


def plan_of(text: str) -> Plan:
    """``moved:103:qvga:sensor=azure_kinect:lag_ms=25:stress``; all behind the seed may be left out, in this order.

    `click.BadParameter` for anything else.
    """
    try:
        return _plan_of(*text.split(":"))
    except (TypeError, ValueError) as error:
        cameras = f"{', '.join(SCENARIOS)} and {', '.join(CAMERAS)}"
        why = f" ({error})" if "=" in text else ""
        raise click.BadParameter(
            f"expected SCENARIO:SEED[:CAMERA][:SETTING=VALUE...][:stress] of {cameras}, got {text!r}{why}",
            param_hint="--simulate",
        ) from error


def _plan_of(scenario: str, seed: str, *more: str) -> Plan:
    stress = more[-1:] == ("stress",)
    rest = more[: len(more) - stress]
    settings = dict(part.split("=", 1) for part in rest if "=" in part)
    sensor = settings.pop("sensor", "kinect_v1")
    named = [part for part in rest[:1] if "=" not in part]
    camera = named[0] if named else SENSORS.get(sensor, ("", None))[0]
    known = scenario in SCENARIOS and seed.isdigit() and camera in CAMERAS
    if not known or len(named) + len(settings) + ("sensor=" in ":".join(rest)) != len(rest):
        raise ValueError(f"settings are sensor={'|'.join(SENSORS)}, lens= and those of the rig")
    if "lens" in settings:
        settings["distortion"] = distortion_of(settings.pop("lens"))
    plan = Plan(scenario, int(seed), camera, stress, sensor, tuple(f"rig.{k}={v}" for k, v in settings.items()))
    sensors_of(camera_of(camera, None), stress, plan.rig, sensor)  # refuses what is out of range
    return plan


def fresh_plans(first_seed: int, count: int) -> list[Plan]:
    """So many recordings of seeds of their own: every scenario by every camera, half of them with stress."""
    several = range(len(FRESH))
    kinds = [(scenario, SEEN_BY[(k + n) % len(SEEN_BY)]) for n in several for k, scenario in enumerate(FRESH)]
    texts = [
        f"{scenario}:{first_seed + k}:{camera}{':stress' * (k // 2 % 2)}"
        for k, (scenario, camera) in zip(range(count), cycle(kinds), strict=False)
    ]
    return [plan_of(text) for text in texts]


def measured(plan: Plan, frames: int, model: str, keep: Path | None) -> dict[str, Any]:
    """The figures of one recording, those that are kept where there are any."""
    file = None if keep is None else keep / f"{plan.name} {frames} {model.replace('/', '_')}.json"
    if file is not None and file.exists():
        row: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
        return row
    row = measure(plan, frames, model)
    if file is not None:
        write_whole(file, json.dumps(row))
    return row


def measure(plan: Plan, frames: int, model: str) -> dict[str, Any]:
    """The figures of one recording, which is gone afterwards."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "recording"
        sensors = sensors_of(camera_of(plan.camera, None), plan.stress, plan.rig, plan.sensor)
        simulate(path, plan.scenario, plan.seed, frames, sensors=sensors, jpeg=True, threads=1)
        with read_source(path, detector_of(model), plan.seed) as source:
            registrar = Registrar(RegistrarParams().replaced(**EAGER, **source.camera))
            outcomes = [*(registrar.process(frame) for frame in source.frames), registrar.finish()]
            registrar.close()
            closures = [closure for outcome in outcomes for closure in outcome.closures]
            refused = [rejected for outcome in outcomes for rejected in outcome.rejected]
            return figures(closures, refused, source.truth)


def figures(closures: Sequence[LoopClosure], refused: Sequence[Rejected], truth: Truth) -> dict[str, Any]:
    """What was accepted, in all and by what speaks for it, and what was refused, judged by truth.

    ``tried`` are the pairs of keyframes that were registered.
    """
    lone = [closure for closure in closures if closure.evidence["matched"] < 2]
    several = [closure for closure in closures if closure.evidence["matched"] >= 2]
    right = Counter(rejected.reason.value for rejected in refused if is_right(rejected, truth))
    return {
        "tried": len(closures) + sum(rejected.reason not in UNTRIED for rejected in refused),
        "all": counts(closures, truth),
        "one object": counts(lone, truth),
        "several objects": counts(several, truth),
        "refused_though_right": dict(right.most_common()),
    }


def counts(closures: Sequence[LoopClosure], truth: Truth) -> dict[str, int]:
    """How many closures there are that the truth knows, and how many of them are strict, loose and false."""
    counted = summarise(truth.errors(closures))
    return {name: counted[name] for name in ("count", "strict", "loose", "false")}


def is_right(rejected: Rejected, truth: Truth) -> bool:
    """Whether the pose that was refused is loosely right."""
    error = truth.error(rejected)
    return error is not None and within(error, LOOSE)


def added(rows: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """The figures of several recordings together."""
    groups = ("all", "one object", "several objects")
    right: Counter[str] = Counter()
    for row in rows:
        right.update(row["refused_though_right"])
    summed = {group: {name: sum(row[group][name] for row in rows) for name in rows[0][group]} for group in groups}
    return {"tried": sum(row["tried"] for row in rows), **summed, "refused_though_right": dict(right.most_common())}


def line(name: str, row: dict[str, Any], group: str = "all") -> str:
    """A line of the table."""
    of = row[group]
    right = ", ".join(f"{reason} {n}" for reason, n in row["refused_though_right"].items()) if group == "all" else ""
    tried = row["tried"] if group == "all" else ""
    return f"{name:32} {tried:>6} {of['count']:>9} {of['strict']:>7} {of['loose']:>6} {of['false']:>6}  {right}"


@click.command()
@click.option(
    "--simulate",
    "plans",
    multiple=True,
    default=PLANS,
    show_default=True,
    metavar="SCENARIO:SEED[:CAMERA][:SETTING=VALUE...][:stress]",
    callback=lambda _context, _option, texts: [plan_of(text) for text in texts],
    help="Simulate this; may be repeated.",
)
@click.option("--first-seed", type=click.IntRange(min=0), help="Recordings of this seed and those after it, instead.")
@click.option("--recordings", type=click.IntRange(min=1), default=25, show_default=True, help="So many of these.")
@click.option("--frames", type=click.IntRange(min=2), default=400, show_default=True, help="Frames of a recording.")
@click.option("--model", default="", help="ONNX model; `truth` takes the true boxes.")
@click.option("--json", "json_file", type=click.Path(dir_okay=False, path_type=Path), help="Write the figures here.")
@click.option("--processes", type=click.IntRange(min=1), default=2, show_default=True, help="Recordings at once.")
@click.option(
    "--keep", type=click.Path(file_okay=False, path_type=Path), help="Keep the figures of each recording here."
)
@click.option("--scheduler", default="", metavar="tcp://HOST:PORT", help="A Dask cluster in place of this machine.")
def main(
    plans: list[Plan],
    first_seed: int | None,
    recordings: int,
    frames: int,
    model: str,
    json_file: Path | None,
    processes: int,
    keep: Path | None,
    scheduler: str,
) -> None:
    """Hold every keyframe of simulated recordings against ten others, and count what is falsely accepted."""
    if first_seed is not None:
        plans = fresh_plans(first_seed, recordings)
    if keep is not None:
        keep.mkdir(parents=True, exist_ok=True)
    rows: dict[str, dict[str, Any]] = {}
    click.echo(HEAD)
    for done in spread(partial(measured, frames=frames, model=model, keep=keep), plans, processes, scheduler):
        rows[done.item.name] = done.result()
        click.echo(line(done.item.name, rows[done.item.name]))
        rows = {plan.name: rows[plan.name] for plan in plans if plan.name in rows}  # whichever ended first
        if json_file is not None:
            total = added(list(rows.values()))
            json_file.write_text(json.dumps({"frames": frames, "recordings": rows, "total": total}, indent=1))
    total = added(list(rows.values()))
    click.echo(line("all of them", total))
    for group in ("one object", "several objects"):
        click.echo(line(f"  {group}", total, group))


if __name__ == "__main__":
    main()
