# SPDX-License-Identifier: Apache-2.0
"""Right recordings under the faults of `stream_faults`: real ones and simulated ones, a few dozen frames in memory.

Each has odometry of a body at 50 Hz that drifts from the truth, and /tf_static that says where the camera sits on it.
Besides the scenarios of `objreg simulate` there is ``robot``: a `loop` driven by a body that turns about the vertical
only, with its camera at one height and one tilt.
"""

from __future__ import annotations

import os
import shutil
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from stream_faults import UNKNOWN_POSE, Aside, static_transform
from stream_recording import (
    BODY,
    CAMERA,
    COLOUR,
    COLOUR_INFO,
    DEPTH,
    DEPTH_INFO,
    IMAGE_TYPE,
    INFO_TYPE,
    ODOM,
    ODOM_TYPE,
    POSE_TYPE,
    TF_STATIC,
    TF_TYPE,
    TRUTH,
    MemoryRecording,
    Stream,
    in_frame,
)

from objreg_ros import share
from objreg_ros.bridge.messages import from_msg, headers
from objreg_ros.data.checked import Array
from objreg_ros.geometry import interpolate, inverse, pose, rotation_from_vector
from objreg_tools.recording import Recording, open_recording
from objreg_tools.recording.drift import DriftingOdometry
from objreg_tools.recording.inputs import Inputs, choose_inputs
from objreg_tools.recording.rosbag import messages
from objreg_tools.simulation.scenarios import RecordingPlan, make_plan
from objreg_tools.simulation.write import simulate, write_plan
from objreg_tools.truth import Truth

R_BODY_OPTICAL = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])  # x forward, y left, z up
ON_BODY_M = np.array([0.2, 0.03, 1.1])
TILT_DEG = 22.0  # by which the robot's camera looks down
ODOM_STEP_NS = 20_000_000
ROBOT = "robot"
SIMULATED_FRAMES = 240  # the truth between the frames that are taken is known too


@dataclass(frozen=True)
class Ground:
    """A right recording, and how it is run: its file, the detector's model and threshold, whether the body is level."""

    name: str
    path: Path
    model: str
    threshold: float
    is_level: bool = False

    @property
    def T_body_camera(self) -> Array:
        """Where the camera sits on the body: looking ahead, or down where that is a robot's."""
        down = rotation_from_vector(np.array([-np.radians(TILT_DEG if self.is_level else 0.0), 0.0, 0.0]))
        return pose(R_BODY_OPTICAL @ down, ON_BODY_M)


@dataclass(frozen=True, eq=False)
class Loaded:
    """A ground in memory: its pictures without odometry, and its truth."""

    ground: Ground
    pictures: MemoryRecording
    truth: Truth

    def recording(self, odometry: bool, seed: int = 1) -> MemoryRecording:
        """The right recording; ``seed`` is that of the drift."""
        return self.pictures.having(self._odometry(seed)) if odometry else self.pictures

    def aside(self, other: Loaded) -> Aside:
        """What faults need to know of it; ``other`` is the recording of another robot."""
        return Aside(self.ground.T_body_camera, self.ground.is_level, np.array(other.truth.poses))

    def _odometry(self, seed: int) -> dict[str, Stream]:
        T_body_camera = self.ground.T_body_camera
        made = [
            (ns, messages.odometry(T_body_camera @ T @ inverse(T_body_camera), UNKNOWN_POSE, ns, "odom", BODY))
            for ns, T in drifted(self.truth, seed)
        ]
        static = static_transform(T_body_camera, made[0][0], BODY, CAMERA)
        return {TF_STATIC: Stream.of(TF_TYPE, [(made[0][0], static)]), ODOM: Stream.of(ODOM_TYPE, made)}


def drifted(truth: Truth, seed: int) -> list[tuple[int, Array]]:
    """When, and ``T_first_camera`` by an odometry that drifts, in steps of `ODOM_STEP_NS`."""
    odometry = DriftingOdometry(seed)
    poses = [odometry.step(T) for T in truth.poses]
    stamps = np.array(truth.stamps_ns)
    out = []
    for ns in [*range(int(stamps[0]), int(stamps[-1]), ODOM_STEP_NS), int(stamps[-1])]:
        k = min(int(np.searchsorted(stamps, ns, side="right")) - 1, len(stamps) - 2)
        share_of_step = (ns - int(stamps[k])) / int(stamps[k + 1] - stamps[k])
        out.append((ns, interpolate(poses[k], poses[k + 1], share_of_step)))
    return out


@lru_cache(maxsize=3)
def load(ground: Ground, frames: int) -> Loaded:
    """A ground in memory, at most ``frames`` of its frames, evenly spread. ValueError for one that lacks something."""
    with open_recording(ground.path) as recording:
        inputs = choose_inputs(recording.topics)
        truth = Truth.of(recording, inputs.ground_truth)
        if not inputs.complete or inputs.depth is None or len(truth.poses) < 2:
            raise ValueError(f"{ground.path}: expected colour, depth, camera_info and ground truth, got {inputs}")
        return Loaded(ground, _pictures(recording, inputs, truth, frames), truth)


def _pictures(recording: Recording, inputs: Inputs, truth: Truth, frames: int) -> MemoryRecording:
    count = min(recording.topics[topic].count for topic in (inputs.image, inputs.depth) if topic)
    taken = set(np.linspace(0, count - 1, min(frames, count)).round().astype(int).tolist())
    colour, depth = (_messages(recording, topic, taken) for topic in (inputs.image, inputs.depth))
    info = in_frame(next(iter(recording.records([str(inputs.camera_info)]))).message, CAMERA)
    at = [headers.stamp_ns(message) for message in depth]
    infos = [(ns, replace(info, header=messages.header(ns, CAMERA))) for ns in at]
    poses = zip(truth.stamps_ns, truth.poses, strict=True)
    streams = {
        COLOUR_INFO: Stream.of(INFO_TYPE, infos),
        DEPTH_INFO: Stream.of(INFO_TYPE, infos),
        COLOUR: Stream.of(IMAGE_TYPE, [(headers.stamp_ns(m), _plain(m)) for m in colour]),
        DEPTH: Stream.of(IMAGE_TYPE, [(ns, in_frame(m, CAMERA)) for ns, m in zip(at, depth, strict=True)]),
        TRUTH: Stream.of(POSE_TYPE, [(ns, messages.pose_stamped(T, ns, "world")) for ns, T in poses]),
    }
    return MemoryRecording(recording.path, streams)


def _messages(recording: Recording, topic: str | None, taken: set[int]) -> list[Any]:
    return [record.message for k, record in enumerate(recording.records([str(topic)])) if k in taken]


def _plain(message: Any) -> Any:
    """A colour picture as Image, whatever it came as."""
    return messages.image(from_msg.image(message).rgb, "rgb8", headers.stamp_ns(message), CAMERA)


def levelled(plan: RecordingPlan) -> RecordingPlan:
    """The plan as a robot drives it: at one height, with a camera that looks down by `TILT_DEG`."""
    height = float(plan.T_world_camera[:, 2, 3].mean())
    poses = np.array([_driven(T, height) for T in plan.T_world_camera])
    return replace(plan, T_world_camera=poses)


def _driven(T_world_camera: Array, height: float) -> Array:
    heading = np.arctan2(T_world_camera[1, 2], T_world_camera[0, 2])
    turn = rotation_from_vector(np.array([0.0, 0.0, heading]))
    down = rotation_from_vector(np.array([-np.radians(TILT_DEG), 0.0, 0.0]))
    return pose(turn @ R_BODY_OPTICAL @ down, np.array([*T_world_camera[:2, 3], height]))


def simulated(folder: Path, scenario: str, seed: int) -> Ground:
    """The ground of a scenario, made if it is not there yet."""
    path = folder / f"{scenario}_{seed}_{SIMULATED_FRAMES}"
    if not path.exists():
        part = path.with_name(f"{path.name}.part")
        shutil.rmtree(part, ignore_errors=True)
        if scenario == ROBOT:
            plan = levelled(make_plan("loop", seed, SIMULATED_FRAMES))
            write_plan(part, plan, ROBOT, seed, jpeg=True)
        else:
            simulate(part, scenario, seed, SIMULATED_FRAMES, jpeg=True)
        os.replace(part, path)
    return Ground(f"{scenario}:{seed}", path.resolve(), share.EMBEDDED, 0.5, scenario == ROBOT)
