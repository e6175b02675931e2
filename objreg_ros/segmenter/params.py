# SPDX-License-Identifier: Apache-2.0
"""The segmenter's parameters."""

from __future__ import annotations

from dataclasses import dataclass

from objreg_ros.data.checked import Array
from objreg_ros.geometry import mounting
from objreg_ros.params import MountedParams, Params, param

PAPER_Z_MAX, PAPER_Y_MAX = 1.75, 0.75  # the passthrough limits of the founding method, metres


@dataclass(frozen=True)
class SegmenterParams(Params):
    """The parameters of the segmenter."""

    preset: str = param("default", "the method; paper is the founding filter of each box", choices=("default", "paper"))
    z_min: float = param(0.2, "nearest depth that is believed", "m", ge=0.0, live=True)
    z_max: float = param(4.0, "farthest depth that is believed (1.75 in preset paper)", "m", ge=0.1, live=True)
    y_max: float = param(
        100.0, "farthest point below or above the camera's axis (0.75 in preset paper)", "m", ge=0.0, live=True
    )
    min_points: int = param(80, "an object of fewer points is not published", ge=1, live=True)
    unnamed: bool = param(
        True, "what stands on a support or apart from everything is an object without a name", live=True
    )
    margin: float = param(0.15, "how far around a box is looked at, of the box's size", ge=0.0, le=1.0, live=True)
    jump: float = param(0.012, "depth step that ends an object, at the camera", "m", ge=0.001, live=True)
    jump_z2: float = param(0.012, "how the depth step grows with squared depth", "1/m", ge=0.0, live=True)
    crease: float = param(
        20.0, "a concave bend sharper than this separates two objects", "deg", ge=5.0, le=90.0, live=True
    )
    height: float = param(
        0.0005, "a point this far above the support still belongs to it, if there were no noise", "m", ge=0.0, live=True
    )
    roll: float = param(
        0.0,
        "how far clockwise, along its line of sight, the camera is turned; 180: upside down",
        "deg",
        ge=-360.0,
        le=360.0,
    )
    up_tilt: float = param(75.0, "most tilt of the camera from upright, apart from `roll`", "deg", ge=5.0, le=89.0)
    support_area: float = param(0.02, "least visible area of a support surface", "m²", ge=0.0, live=True)
    view_step: int = param(
        4,
        "the view keeps one pixel of so many in each row and column; a smaller step is taken where less than 160 "
        "columns would be left, a larger one where more than 160 000 pixels would be",
        ge=1,
        le=32,
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.z_min >= self.z_max:
            raise ValueError(f"z_max: expected more than z_min ({self.z_min:g}), got {self.z_max:g}")

    @property
    def limits(self) -> tuple[float, float, float]:
        """The passthrough limits (z_min, z_max, y_max) in metres that hold for the preset."""
        z_max, y_max = (PAPER_Z_MAX, PAPER_Y_MAX) if self.preset == "paper" else (self.z_max, self.y_max)
        return self.z_min, z_max, y_max

    @property
    def jump_bounds(self) -> tuple[float, float]:
        """(a, b) of the depth step a + b z² in metres between two surfaces."""
        return self.jump, self.jump_z2


@dataclass(frozen=True)
class SegmenterNodeParams(MountedParams):
    """How the segmenter's node brings its inputs together."""

    source: str = param(
        "auto", "where depth comes from; auto takes whichever publishes first", choices=("auto", "points", "depth")
    )
    detections: str = param(
        "auto",
        "who says where objects are: our detector's table, vision_msgs of any other by `detections_in`, or a picture "
        "of masks by `masks`; auto takes whichever publishes first",
        choices=("auto", "table", "vision_msgs", "masks"),
    )
    slop: float = param(0.02, "largest distance in time between depth and what goes with it", "s", ge=0.0)
    rectified: str = param(
        "auto",
        "which of depth and image come without the distortion that camera_info gives; auto: those whose topic has "
        "rect in its name; the others are rectified here",
        choices=("auto", "all", "none"),
    )
    camera: str = param(
        "",
        "the camera in place of camera_info: fx,fy,cx,cy[,width,height] in pixels, or a file of ROS, OpenCV, "
        "RTAB-Map, ORB-SLAM, kalibr or Open3D; of another size of the same shape it is scaled",
    )
    colour: bool = param(True, "take the colour of the points from `image` when depth comes as an image")
    level_odom: bool = param(
        False, "take gravity from `odom`, whose frame an IMU keeps level with z up; frames are no more often than it"
    )
    T_camera_imu: tuple[float, ...] = param(
        (),
        "the IMU in the camera's optical frame: x y z qx qy qz qw; empty: as /tf_static says, or the optical frame "
        "where `imu` names the same one",
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        mounting(self.T_camera_imu, "T_camera_imu")

    @property
    def imu_mounting(self) -> Array | None:
        """``T_camera_imu`` as a (4, 4) pose, None where none is set."""
        return mounting(self.T_camera_imu, "T_camera_imu")
