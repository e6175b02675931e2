# SPDX-License-Identifier: Apache-2.0
"""Stages that say simple things, for tests of what lies between them."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.closures import LoopClosure, Reason, Rejected, Relocalised
from objreg_ros.data.frames import Frame, ObjectCloud, View
from objreg_ros.data.images import ColourImage, DepthImage, Detections
from objreg_ros.geometry import back_project, inverse
from objreg_ros.segmenter.gravity.gravity_choice import GravityChoice
from objreg_ros.segmenter.sensor.sensor_estimate import SensorEstimate
from objreg_tools.offline.stages import Stages


@dataclass
class Outcome:
    closures: tuple[LoopClosure, ...] = ()
    rejected: tuple[Rejected, ...] = ()


class OneBox:
    """Sees one cup in every image."""

    def detect(self, image: ColourImage) -> Detections:
        height, width = image.rgb.shape[:2]
        return Detections(
            xyxy=np.array([[1, 1, 9, 9]], np.float32),
            score=np.array([0.5], np.float32),
            label=("cup",),
            image_hw=(height, width),
            stamp_ns=image.stamp_ns,
        )


class OneCloud:
    """Cuts one point out of every depth image."""

    choice = GravityChoice(None, 0.0, "nothing")
    sensor = SensorEstimate()

    def __init__(self) -> None:
        self.received_sigma_deg: list[float | None] = []

    def segment(
        self,
        detections: Detections,
        depth: DepthImage,
        gravity: np.ndarray | None = None,
        *,
        gravity_sigma_deg: float | None = None,
    ) -> Frame:
        self.received_sigma_deg.append(gravity_sigma_deg)
        cloud = ObjectCloud(
            label=detections.label[0],
            score=0.1,
            instance=1,
            xyz=np.array([[0, 0, depth.depth[5, 5]]], np.float32),
            normals=np.array([[0, 0, -1]], np.float32),
            rgb=None if depth.rgb is None else depth.rgb[5:6, 5],
            flags=np.zeros(1, np.uint16),
            density=0.1,
        )
        camera = depth.intrinsics
        xyz = back_project(depth.depth, camera.fx, camera.fy, camera.cx, camera.cy)
        xyz[depth.depth == 0.0] = np.nan
        return Frame(
            objects=(cloud,),
            support=None,
            view=View(xyz=xyz, grey=None, intrinsics=camera),
            gravity=np.array([0.0, 1.0, 0.0]) if gravity is None else gravity,
            gravity_confidence=0.3,
            T_odom_camera=None,
            stamp_ns=depth.stamp_ns,
        )


@dataclass
class Chain:
    """Closes every frame with the one before by odometry, and refuses where there is none; remembers its frames."""

    frames: list[Frame] = field(default_factory=list)
    finished: bool = False
    relocalised: Relocalised | None = None
    whereabouts: str = "no closure to an earlier session yet"

    def counts(self) -> dict[str, int]:
        return {"keyframes": len(self.frames)}

    @property
    def tracked(self) -> tuple[int, Array] | None:
        return (0, np.eye(4)) if self.frames else None

    def process(self, frame: Frame) -> Outcome:
        self.frames.append(frame)
        if len(self.frames) < 2:
            return Outcome()
        before = self.frames[-2]
        if frame.T_odom_camera is None or before.T_odom_camera is None:
            refused = Rejected(
                reason=Reason.NO_CANDIDATE, from_ns=before.stamp_ns, to_ns=frame.stamp_ns, detail="no odometry"
            )
            return Outcome(rejected=(refused,))
        T_from_to = inverse(before.T_odom_camera) @ frame.T_odom_camera
        closure = LoopClosure(
            from_ns=before.stamp_ns, to_ns=frame.stamp_ns, T_from_to=T_from_to, covariance=np.eye(6), labels=("cup",)
        )
        return Outcome(closures=(closure,))

    def finish(self, doubt: str = "") -> Outcome:
        self.finished = True
        return Outcome()


def simple_stages() -> tuple[Stages, Chain]:
    chain = Chain()
    return Stages(OneBox(), OneCloud(), chain), chain
