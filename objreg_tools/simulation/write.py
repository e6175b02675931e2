# SPDX-License-Identifier: Apache-2.0
"""Writes a planned recording as an ordinary rosbag2 recording (mcap), with its truth beside it.

| topic | type | what |
| --- | --- | --- |
| `/image` (`/image/compressed`) | sensor_msgs/Image rgb8 (CompressedImage, jpeg) | colour |
| `/depth/image` | sensor_msgs/Image 16UC1 | depth in mm, registered to colour, 0 where there is none |
| `/camera_info` | sensor_msgs/CameraInfo | the camera of both; D is the lens's distortion (plumb_bob) |
| `/points` (optional) | sensor_msgs/PointCloud2 | organised x y z rgb, NaN where there is no depth |
| `/odom` | nav_msgs/Odometry | drifting pose of `camera` in `odom` |
| `/ground_truth` | geometry_msgs/PoseStamped | true pose of the camera in `world` |

Of several robots each has a recording of its own. Its name is before its frames, as in `robot1/camera` and
`robot1/odom`; the world and the clock are those of all.

The folder also gets `truth/`, see `objreg_tools.simulation.truth`.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.images import Intrinsics
from objreg_ros.geometry import back_project
from objreg_tools.recording import Record, write_rosbag2
from objreg_tools.recording.rosbag import messages
from objreg_tools.recording.rosbag.writer import whole_or_gone
from objreg_tools.simulation.fleet import make_fleet
from objreg_tools.simulation.odometry import drifted
from objreg_tools.simulation.params import (
    ColourParams,
    DepthParams,
    DepthSensing,
    OdometryParams,
    RigParams,
    StereoParams,
    StressParams,
    TimeOfFlightParams,
)
from objreg_tools.simulation.rendering.render import Rendering, render
from objreg_tools.simulation.scenarios import RecordingPlan, make_plan
from objreg_tools.simulation.sensors.camera import KINECT
from objreg_tools.simulation.sensors.rig import Motion, Rig
from objreg_tools.simulation.truth import TruthWriter

START_NS = 1_700_000_000_000_000_000
"""When simulated recordings begin: a fixed time, so that the same seed gives the same bytes."""
CAMERA_FRAME, ODOM_FRAME, WORLD_FRAME = "camera", "odom", "world"
JPEG_QUALITY = 90
HOW = {DepthParams: "structured light", StereoParams: "active stereo", TimeOfFlightParams: "time of flight"}
POINT = np.dtype(
    {"names": ["x", "y", "z", "rgb"], "formats": ["<f4", "<f4", "<f4", "<u4"], "offsets": [0, 4, 8, 16], "itemsize": 32}
)
"""The layout of a point of `depth_image_proc` and the Kinect's drivers."""


@dataclass(frozen=True)
class Sensors:
    """The camera of a recording and everything that is wrong with it."""

    intrinsics: Intrinsics = KINECT
    depth: DepthSensing = field(default_factory=DepthParams)
    colour: ColourParams = field(default_factory=ColourParams)
    stress: StressParams = field(default_factory=StressParams)
    odometry: OdometryParams = field(default_factory=OdometryParams)
    rig: RigParams = field(default_factory=RigParams)

    def described(self) -> dict[str, Any]:
        """Every parameter by section and name, and in ``sensor`` how depth is measured."""
        sections = {"depth": self.depth, "colour": self.colour, "stress": self.stress}
        known = {name: asdict(params) for name, params in sections.items()}
        return {"sensor": HOW[type(self.depth)], **known, "odometry": asdict(self.odometry), "rig": asdict(self.rig)}


def simulate(
    path: Path | str,
    scenario: str = "loop",
    seed: int = 0,
    frames: int = 600,
    rate: float = 30.0,
    sensors: Sensors | None = None,
    points: bool = False,
    jpeg: bool = False,
    threads: int = 2,
    progress: Callable[[int], object] = lambda done: None,
) -> RecordingPlan:
    """Write the recording of a scenario to a new folder; returns its plan.

    ``progress`` is called with the number of frames that are done. Everything in the messages and in the truth follows
    from the arguments, ``threads`` and ``progress`` aside. ValueError for a scenario that there is not, FileExistsError
    for a folder that is already there.
    """
    sensors = sensors or Sensors()
    _refuse_old(Path(path))
    plan = make_plan(scenario, seed, frames, rate, sensors.stress.occluders)
    write_plan(path, plan, scenario, seed, sensors, points, jpeg, threads, progress)
    return plan


def simulate_fleet(
    path: Path | str,
    scenario: str = "robots",
    seed: int = 0,
    frames: int = 600,
    rate: float = 30.0,
    sensors: Sensors | None = None,
    points: bool = False,
    jpeg: bool = False,
    threads: int = 2,
    progress: Callable[[int], object] = lambda done: None,
) -> list[RecordingPlan]:
    """As `simulate`, of a scenario of several robots: a recording of each, by its name, in a new folder.

    ``progress`` is called with the number of frames that are done of all robots together. What fails leaves the
    recordings of the robots before.
    """
    sensors = sensors or Sensors()
    _refuse_old(Path(path))
    plans = make_fleet(scenario, seed, frames, rate, sensors.stress.occluders)
    for k, plan in enumerate(plans):
        of_all = partial(_and_before, progress, k * frames)
        write_plan(Path(path) / plan.robot, plan, scenario, seed, sensors, points, jpeg, threads, of_all)
    return plans


def _and_before(progress: Callable[[int], object], before: int, done: int) -> None:
    progress(before + done)


def _refuse_old(path: Path) -> None:
    if path.exists():
        raise FileExistsError(f"{path}: expected a new folder, got one that exists; choose another name or remove it")


def write_plan(
    path: Path | str,
    plan: RecordingPlan,
    name: str,
    seed: int,
    sensors: Sensors | None = None,
    points: bool = False,
    jpeg: bool = False,
    threads: int = 2,
    progress: Callable[[int], object] = lambda done: None,
) -> None:
    """As `simulate`, of a plan of one's own; its truth calls it ``name``."""
    sensors, sown = sensors or Sensors(), _sown(seed, plan.robot)
    for scene in plan.scenes:
        scene.prepare()
    truth = TruthWriter(plan, name, seed, sensors.intrinsics, sensors.described())
    rig = None if sensors.rig.is_plain else Rig(sensors.rig, sensors.intrinsics, sown)
    odom, camera = _of(plan.robot, ODOM_FRAME), _of(plan.robot, CAMERA_FRAME)
    T_odom_camera, covariance = drifted(plan.T_world_camera, sensors.odometry, sown)

    def records() -> Iterator[Record]:
        for k, image in enumerate(_rendered(plan, sown, sensors, rig, threads)):
            stamp_ns = START_NS + plan.start_ns + round(k * 1e9 / plan.rate)
            truth.write_frame(stamp_ns, int(plan.scene_of[k]), image)
            odometry = messages.odometry(T_odom_camera[k], covariance[k], stamp_ns, odom, camera)
            yield from _camera_records(image, stamp_ns, camera, points, jpeg, rig)
            yield from _pose_records(image.T_world_camera, odometry, stamp_ns)
            progress(k + 1)

    write_rosbag2(path, records())
    with whole_or_gone(Path(path)):
        truth.write(Path(path))


def _sown(seed: int, robot: str) -> int:
    """The seed of what is random in a robot's sensors and odometry; the seed itself where there is but one robot."""
    return int(np.random.default_rng([seed, *robot.encode()]).integers(2**31)) if robot else seed


def _of(robot: str, frame: str) -> str:
    """The name of a frame of a robot."""
    return f"{robot}/{frame}" if robot else frame


def _rendered(plan: RecordingPlan, seed: int, sensors: Sensors, rig: Rig | None, threads: int) -> Iterator[Rendering]:
    """Every frame in order; ``threads`` of them are in the making at once, and as many more may wait."""
    with ThreadPoolExecutor(threads) as pool:
        ahead: deque[Future[Rendering]] = deque()
        for k in range(len(plan)):
            ahead.append(pool.submit(_frame, plan, k, seed, sensors, rig))
            if len(ahead) > 2 * threads:
                yield ahead.popleft().result()
        while ahead:
            yield ahead.popleft().result()


def _frame(plan: RecordingPlan, k: int, seed: int, sensors: Sensors, rig: Rig | None) -> Rendering:
    scene = plan.scenes[int(plan.scene_of[k])]
    noise_seed = int(np.random.default_rng([seed, 41, k]).integers(2**31))
    of = (sensors.depth, sensors.colour, sensors.stress)
    if rig is not None:
        return rig.take_picture(scene, Motion(plan.T_world_camera, plan.rate), k / plan.rate, noise_seed, *of)
    return render(scene, plan.T_world_camera[k], sensors.intrinsics, noise_seed, *of)


def _camera_records(
    image: Rendering, stamp_ns: int, frame: str, points: bool, jpeg: bool, rig: Rig | None
) -> Iterator[Record]:
    assert image.rgb is not None
    millimetres = np.rint(image.depth * 1000.0).astype(np.uint16)
    colour = _compressed(image.rgb, stamp_ns, frame) if jpeg else messages.image(image.rgb, "rgb8", stamp_ns, frame)
    lens = rig.lens if rig is not None else None
    distortion = (0.0,) * 5 if lens is None else lens.distortion
    info = messages.camera_info(image.intrinsics, stamp_ns, frame, distortion)
    yield Record.of("/camera_info", info, stamp_ns)
    yield Record.of("/image/compressed" if jpeg else "/image", colour, stamp_ns)
    yield Record.of("/depth/image", messages.image(millimetres, "16UC1", stamp_ns, frame), stamp_ns)
    if points:
        cloud = organised(image, None if lens is None else lens.rays)
        yield Record.of("/points", messages.point_cloud(cloud, stamp_ns, frame), stamp_ns)


def _pose_records(T_world_camera: Array, odometry: object, stamp_ns: int) -> Iterator[Record]:
    yield Record.of("/odom", odometry, stamp_ns)
    yield Record.of("/ground_truth", messages.pose_stamped(T_world_camera, stamp_ns, WORLD_FRAME), stamp_ns)


def _compressed(rgb: Array, stamp_ns: int, frame: str) -> object:
    """sensor_msgs/CompressedImage."""
    jpeg = cv2.imencode(".jpg", rgb[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])[1]
    header = messages.header(stamp_ns, frame)
    return messages.message(
        "sensor_msgs/CompressedImage", header=header, format="rgb8; jpeg compressed bgr8", data=jpeg
    )


def organised(image: Rendering, rays: Array | None = None) -> Array:
    """(H, W) records x y z rgb of the measured points in the camera frame, NaN where there is no depth.

    ``rays (H, W, 2)`` are x/z and y/z of every pixel where a lens bends them.
    """
    assert image.rgb is not None
    i = image.intrinsics
    xyz = back_project(image.depth, i.fx, i.fy, i.cx, i.cy)
    if rays is not None:
        xyz[..., :2] = rays * image.depth[..., None]
    xyz[image.depth == 0] = np.nan
    records = np.zeros(image.depth.shape, POINT)
    for k, name in enumerate("xyz"):
        records[name] = xyz[..., k]
    red, green, blue = (image.rgb[..., k].astype(np.uint32) for k in range(3))
    records["rgb"] = red << 16 | green << 8 | blue
    return records
