# SPDX-License-Identifier: Apache-2.0
"""`objreg simulate`: a recording with ground truth."""

from __future__ import annotations

import math
from pathlib import Path

import click
from tqdm import tqdm

from objreg_ros.data.images import Intrinsics
from objreg_ros.params import Params
from objreg_tools.cli.paths import OutputPath
from objreg_tools.cli.run_output import print_next
from objreg_tools.simulation.fleet import FLEETS, ROBOTS
from objreg_tools.simulation.params import ColourParams, DepthParams, OdometryParams, RigParams, StressParams
from objreg_tools.simulation.scenarios import SCENARIOS, RecordingPlan
from objreg_tools.simulation.sensors.camera import CAMERAS, LENSES, SENSORS
from objreg_tools.simulation.write import Sensors, simulate, simulate_fleet

SECTIONS: dict[str, type[Params]] = {
    "depth": DepthParams,
    "colour": ColourParams,
    "stress": StressParams,
    "odometry": OdometryParams,
    "rig": RigParams,
}
HARD = {"depth_bias": 0.005, "warp": 0.003, "ragged": 0.9, "motion_blur": 4.0, "occluders": 5}


def _list(context: click.Context, _: click.Parameter, wanted: bool) -> None:
    if wanted:
        click.echo(parameter_table())
        context.exit()


@click.command()
@click.argument("out", type=OutputPath(path_type=Path))
@click.option(
    "--scenario",
    type=click.Choice([*SCENARIOS, *FLEETS]),
    default="loop",
    show_default=True,
    help="The path of the camera; of three robots' in `robots`.",
)
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="Seed of all random numbers.")
@click.option(
    "--frames", type=click.IntRange(2), default=600, show_default=True, help="Number of image pairs, of each robot."
)
@click.option("--rate", type=click.FloatRange(1.0, 240.0), default=30.0, show_default=True, help="Frames per second.")
@click.option(
    "--sensor", type=click.Choice(list(SENSORS)), default="kinect_v1", show_default=True, help="How depth is measured."
)
@click.option("--intrinsics", help=f"{', '.join(CAMERAS)}, or fx,fy,cx,cy; the sensor's own by default.")
@click.option("--size", help="WIDTHxHEIGHT in pixels; a named camera is scaled to it.")
@click.option("--points", is_flag=True, help="Also write an organised PointCloud2 (9.8 MB a frame at 640x480).")
@click.option("--jpeg", is_flag=True, help="Write image/compressed (jpeg) instead of image.")
@click.option(
    "--stress", is_flag=True, help="Bias and warp the depth, fray its edges, blur the colour, crowd the tables."
)
@click.option("--lens", default="", help=f"Bend the pictures by {', '.join(LENSES)}, or k1,k2,p1,p2[,k3] (plumb_bob).")
@click.option("--lag-ms", type=float, default=0.0, help="Depth shows the pose of so much before its stamp.")
@click.option("--rolling-ms", type=float, default=0.0, help="Time from the first row of colour to the last.")
@click.option("--blur-ms", type=float, default=0.0, help="Exposure of colour, over which motion blurs it.")
@click.option("--misregistration-px", type=float, default=0.0, help="Shift of depth against colour.")
@click.option("--misregistration-deg", type=float, default=0.0, help="Rotation of depth against colour.")
@click.option("--misregistration-mm", type=float, default=0.0, help="Displacement of the depth camera.")
@click.option(
    "--set", "settings", multiple=True, metavar="SECTION.NAME=VALUE", help="Change one parameter; see --list."
)
@click.option("--list", is_flag=True, is_eager=True, expose_value=False, callback=_list, help="List the parameters.")
def command(
    out: Path,
    scenario: str,
    seed: int,
    frames: int,
    rate: float,
    sensor: str,
    intrinsics: str | None,
    size: str | None,
    points: bool,
    jpeg: bool,
    stress: bool,
    lens: str,
    settings: tuple[str, ...],
    **rig: float,
) -> None:
    """Simulate a depth camera that is carried through a room, and write OUT, a rosbag2 folder with OUT/truth in it.

    Of several robots each has such a folder in OUT: OUT/robot1, OUT/robot2 and so on.
    """
    camera = camera_of(intrinsics or SENSORS[sensor][0], size)
    sensors = sensors_of(camera, stress, (*_rig_settings(lens, rig), *settings), sensor)
    plans = _simulated(out, scenario, (seed, frames, rate, sensors, points, jpeg))
    for plan in plans:
        _print_summary(out / plan.robot, plan, scenario, seed, rate)
    print_next("objreg", "inspect", str(out / plans[0].robot))


def _simulated(out: Path, scenario: str, of: tuple[int, int, float, Sensors, bool, bool]) -> list[RecordingPlan]:
    """Write the recordings of a scenario under a bar; ``of`` are seed, frames and so on, as `simulate` takes them."""
    robots = ROBOTS if scenario in FLEETS else 1
    with tqdm(total=robots * of[1], unit="frame", desc=scenario, disable=None) as bar:
        if scenario in FLEETS:
            return simulate_fleet(out, scenario, *of, progress=lambda n: bar.update(n - bar.n))
        return [simulate(out, scenario, *of, progress=lambda n: bar.update(n - bar.n))]


def _print_summary(out: Path, plan: RecordingPlan, scenario: str, seed: int, rate: float) -> None:
    frames = len(plan)
    click.echo(f"{out}: {scenario}, seed {seed}, {frames} frames at {plan.rate:.3g} Hz, truth in {out / 'truth'}")
    if plan.rate < rate - 1e-6:
        click.echo(f"note: {frames} frames are few for this path, so they come at {plan.rate:.3g} Hz, not {rate:g}")


def camera_of(name: str, size: str | None) -> Intrinsics:
    """The camera of a name or of four numbers, scaled to ``size`` if it is given; ValueError states what it expects."""
    width, height = _size_of(size) if size else (0, 0)
    if name in CAMERAS:
        camera = CAMERAS[name]
        return _scaled(camera, width, height) if size else camera
    try:
        fx, fy, cx, cy = (_finite(part) for part in name.split(","))
    except ValueError:
        raise ValueError(f"intrinsics: expected {', '.join(CAMERAS)} or fx,fy,cx,cy in pixels, got {name!r}") from None
    if not size:
        width, height = round(2 * cx + 1), round(2 * cy + 1)
    return Intrinsics(fx=fx, fy=fy, cx=cx, cy=cy, width=width, height=height)


def _finite(text: str) -> float:
    number = float(text)
    if not math.isfinite(number):
        raise ValueError(f"expected a number, got {text}")
    return number


def _size_of(size: str) -> tuple[int, int]:
    parts = size.lower().split("x")
    if len(parts) != 2 or not all(part.isdigit() and 16 <= int(part) <= 4096 for part in parts):
        raise ValueError(f"size: expected WIDTHxHEIGHT, each 16 to 4096 px, got {size!r}")
    return int(parts[0]), int(parts[1])


def _scaled(camera: Intrinsics, width: int, height: int) -> Intrinsics:
    """The camera with as wide a view in another resolution."""
    x, y = width / camera.width, height / camera.height
    cx, cy = (camera.cx + 0.5) * x - 0.5, (camera.cy + 0.5) * y - 0.5
    return Intrinsics(fx=camera.fx * x, fy=camera.fy * y, cx=cx, cy=cy, width=width, height=height)


def distortion_of(lens: str) -> str:
    """The numbers of a lens by its name, or these numbers themselves; ValueError for anything else."""
    numbers = ",".join(map(str, LENSES[lens])) if lens in LENSES else lens
    try:
        count = len([_finite(part) for part in numbers.split(",")])
    except ValueError:
        count = 0
    if count not in (4, 5):
        raise ValueError(f"lens: expected {', '.join(LENSES)} or k1,k2,p1,p2[,k3], got {lens!r}")
    return numbers


def _rig_settings(lens: str, rig: dict[str, float]) -> list[str]:
    """Options as settings, those that are not at zero."""
    bent = [f"rig.distortion={distortion_of(lens)}"] if lens else []
    return [*bent, *(f"rig.{name}={value}" for name, value in rig.items() if value)]


def sensors_of(camera: Intrinsics, stress: bool, settings: tuple[str, ...], sensor: str = "kinect_v1") -> Sensors:
    """The sensors with every ``section.name=value`` applied; ValueError for one that there is not or out of range.

    ``sensor`` names how depth is measured, and so what the section ``depth`` is.
    """
    if sensor not in SENSORS:
        raise ValueError(f"sensor: expected one of {', '.join(SENSORS)}, got {sensor!r}")
    sections = {**SECTIONS, "depth": type(SENSORS[sensor][1])}
    values: dict[str, dict[str, object]] = {section: {} for section in sections}
    values["stress"].update(HARD if stress else {})
    for setting in settings:
        key, _, text = setting.partition("=")
        section, _, name = key.partition(".")
        if section not in SECTIONS or not text:
            raise ValueError(
                f"--set: expected SECTION.NAME=VALUE with a section of {', '.join(SECTIONS)}, got {setting!r}"
            )
        values[section][name] = _parsed(sections[section], name, text)
    made = {section: _made(section, sections[section], chosen) for section, chosen in values.items()}
    return Sensors(camera, **made)  # type: ignore[arg-type]


def _made(section: str, kind: type[Params], values: dict[str, object]) -> Params:
    try:
        return kind.from_mapping(values)
    except ValueError as error:
        raise ValueError(f"--set {section}: {str(error).removeprefix(f'{kind.__name__}: ')}") from error


def _parsed(section: type[Params], name: str, text: str) -> object:
    """A value from text as its parameter wants it; left as text where that fails, for the parameter to refuse."""
    declaration = next((d for d in section.declarations() if d.name == name), None)
    if declaration is None:
        return text
    try:
        if declaration.many:
            return tuple(declaration.kind(part) for part in text.split(","))
        return declaration.kind(text)
    except ValueError:
        return text


def parameter_table() -> str:
    """One line for every parameter: name, default, unit, range, meaning."""
    lines = []
    measured = [(f"depth of {name}", "depth", type(params)) for name, (_, params) in SENSORS.items()]
    others = [(section, section, kind) for section, kind in SECTIONS.items() if section != "depth"]
    for title, section, kind in (*measured, *others):
        lines.append(f"# {title}")
        for d in kind.declarations():
            about = " ".join(part for part in (f"[{d.unit}]" if d.unit else "", d.range_text) if part)
            lines.append(f"{section}.{d.name} = {d.default}  {about}\n    {d.doc}")
    return "\n".join(lines)
