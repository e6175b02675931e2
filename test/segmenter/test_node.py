# SPDX-License-Identifier: Apache-2.0
"""The segmenter behind its node: messages in, a frame and warnings out."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import rclpy
from bridge.trees import said, transform
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from sensor_msgs.msg import CameraInfo, Image, PointCloud2
from std_msgs.msg import String

from objreg_ros.bridge.camera import lenses
from objreg_ros.bridge.messages import to_msg
from objreg_ros.bridge.node import qos
from objreg_ros.data.images import DepthImage, Detections, Intrinsics
from objreg_ros.lens import Lens
from objreg_ros.segmenter.node import LOOK_S, SegmenterNode

CAMERA = Intrinsics(fx=300.0, fy=300.0, cx=160.0, cy=120.0, width=320, height=240)
NAMES = {0: "cup"}


class Camera:
    """A camera whose info was published before the segmenter came, and that is kept for it or published again."""

    def __init__(self, kept: bool, distortion: tuple[float, ...] = (), model: str = "plumb_bob") -> None:
        self.peer = rclpy.create_node("camera")
        self.info = self.peer.create_publisher(CameraInfo, "camera_info", qos.latched() if kept else qos.stage())
        info = to_msg.camera_info(CAMERA, 1, "eye")
        if distortion:
            info.d, info.distortion_model = list(distortion), model
        self.info.publish(info)
        self.depth = self.peer.create_publisher(Image, "depth/image", qos.stage())
        self.table = self.peer.create_publisher(PointCloud2, "detections_table", qos.stage())
        self.labels = self.peer.create_publisher(String, "labels", qos.latched())
        self.labels.publish(to_msg.labels(NAMES))
        self.said: list[str] = []
        self.node = SegmenterNode()
        self.node.throttled._write = self.said.append
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)
        self.executor.add_node(self.peer)
        self.wait(lambda: min(p.get_subscription_count() for p in (self.depth, self.table, self.labels)) > 0)
        self.wait(lambda: len(self.node.connected) >= (3 if self.node._inputs.camera else 4))

    def wait(self, done: Callable[[], Any], seconds: float = 300.0) -> None:
        end = time.monotonic() + seconds
        while not done():
            assert time.monotonic() < end, f"nothing came; the counters are {self.node.accounting.balance()}"
            self.executor.spin_once(timeout_sec=0.05)

    def see(self, metres: float, frame_id: str, picture_frame_id: str) -> None:
        """One frame with one box."""
        stamp_ns = 10**9
        depth = np.full((CAMERA.height, CAMERA.width), metres, np.float32)
        seen = Detections(
            xyxy=np.array([[100, 70, 220, 170]], np.float32), score=np.ones(1, np.float32), label=("cup",),
            image_hw=depth.shape, stamp_ns=stamp_ns, frame_id=picture_frame_id,
        )  # fmt: skip
        image = DepthImage(depth=depth, rgb=None, intrinsics=CAMERA, stamp_ns=stamp_ns, frame_id=frame_id)
        message = Image(
            header=to_msg.header(stamp_ns, frame_id), height=CAMERA.height, width=CAMERA.width, encoding="32FC1",
            step=4 * CAMERA.width, data=image.depth.tobytes(),
        )  # fmt: skip
        self.table.publish(to_msg.detections_table(seen, NAMES))
        self.depth.publish(message)
        self.wait(
            lambda: self.node.accounting.balance().published + sum(self.node.accounting.balance().dropped.values()) == 1
        )


@pytest.fixture
def made(monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest) -> Iterator[Callable[[bool], Camera]]:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    rclpy.init(args=["--ros-args", "-p", "colour:=false", *getattr(request, "param", ())])
    cameras: list[Camera] = []

    def make(kept: bool = True, **lens: Any) -> Camera:
        cameras.append(Camera(kept, **lens))
        return cameras[-1]

    yield make
    for camera in cameras:
        camera.node.close()
        camera.executor.shutdown()
        camera.peer.destroy_node()
    rclpy.try_shutdown()


def test_a_camera_info_that_was_published_once_and_kept_serves_a_segmenter_that_comes_late(
    made: Callable[..., Camera],
) -> None:
    camera = made()
    camera.see(1.2, "eye", "eye")
    assert camera.said == [] and not camera.node.watch.silent()


def test_a_camera_that_keeps_nothing_is_received_without_a_warning_of_qos(
    made: Callable[..., Camera], capfd: pytest.CaptureFixture[str]
) -> None:
    camera = made(kept=False)
    camera.wait(lambda: camera.node.connected.get("/camera_info"))
    later = time.monotonic() + 2 * LOOK_S
    camera.wait(lambda: time.monotonic() > later)
    camera.info.publish(to_msg.camera_info(CAMERA, 1, "eye"))
    camera.see(1.2, "eye", "eye")
    assert "QoS" not in capfd.readouterr().err and camera.said == []


def test_depth_of_another_frame_than_the_picture_is_reported_with_what_to_do(made: Callable[..., Camera]) -> None:
    camera = made()
    camera.see(1.2, "depth_eye", "colour_eye")
    (line,) = camera.said
    assert "got colour in 'colour_eye' and depth in 'depth_eye'" in line and "align_depth.enable:=true" in line


def test_depth_of_another_sensor_is_brought_into_the_picture_of_colour(
    made: Callable[..., Camera], monkeypatch: pytest.MonkeyPatch
) -> None:
    camera = made()
    met = spied(camera, monkeypatch)
    T_colour_depth = np.eye(4)
    T_colour_depth[0, 3] = -0.12
    camera.node._pipeline.frames.add_transforms(said(transform("colour_eye", "depth_eye", T_colour_depth)))
    of_colour = replace(CAMERA, fx=600.0, fy=600.0, cx=319.5, cy=239.5, width=640, height=480)
    info = camera.peer.create_publisher(CameraInfo, "colour/camera_info", qos.stage())
    camera.wait(lambda: info.get_subscription_count() > 0)
    info.publish(to_msg.camera_info(of_colour, 1, "colour_eye"))
    camera.wait(lambda: camera.node._colour_info is not None)
    camera.see(1.2, "depth_eye", "colour_eye")
    ((_, depth),) = met
    assert depth.frame_id == "colour_eye" and (depth.intrinsics.width, depth.intrinsics.fx) == (320, 300.0)
    assert (depth.depth[120, :289] > 0).all() and not depth.depth[120, 291:].any()  # 30 px at 1.2 m
    assert "is registered here" in camera.node._registered


@pytest.mark.parametrize("made", [("-p", "level_odom:=true")], indirect=True)
def test_frames_without_a_level_odometry_that_is_asked_for_are_reported(made: Callable[..., Camera]) -> None:
    camera = made()
    camera.see(1.2, "eye", "eye")
    (line,) = camera.said
    assert "as level_odom is on, got none: gravity is estimated" in line


def test_millimetres_as_floats_are_reported_with_what_to_do(made: Callable[..., Camera]) -> None:
    camera = made()
    camera.see(1200.0, "eye", "eye")
    (line,) = camera.said
    assert "z_min … z_max" in line and "16UC1" in line


def spied(camera: Camera, monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """The boxes and the depth image of each frame that its segmenter gets."""
    met: list[Any] = []
    segment = camera.node._segmenter.segment
    spy = lambda boxes, depth, *more, **named: (  # noqa: E731
        met.append((boxes.xyxy, depth)) or segment(boxes, depth, *more, **named)
    )
    monkeypatch.setattr(camera.node._segmenter, "segment", spy)
    return met


@pytest.mark.parametrize(
    ("model", "distortion"),
    [
        ("plumb_bob", (-0.3, 0.1, 0.0, 0.0, 0.0)),
        ("rational_polynomial", (0.4, -2.5, 0.0005, -0.0003, 1.4, 0.6, -2.3, 1.3)),
        ("equidistant", (-0.03, 0.01, -0.005, 0.001)),
    ],
)
def test_depth_and_boxes_of_a_lens_are_rectified_before_they_are_segmented(
    model: str, distortion: tuple[float, ...], made: Callable[..., Camera], monkeypatch: pytest.MonkeyPatch
) -> None:
    camera = made(distortion=distortion, model=model)
    met = spied(camera, monkeypatch)
    camera.see(1.2, "eye", "eye")
    ((xyxy, depth),) = met
    of = Lens(model, distortion, CAMERA, CAMERA)
    assert np.array_equal(depth.shown, of.shown) and np.array_equal(depth.depth > 0, of.shown)
    assert np.abs(xyxy - of.rectify_xyxy(np.array([[100, 70, 220, 170]]))).max() < 1e-3
    assert camera.node._lens == f"{of}; rectified"


def test_pictures_that_are_said_to_be_rectified_are_segmented_as_they_come(
    made: Callable[..., Camera], monkeypatch: pytest.MonkeyPatch
) -> None:
    camera = made(distortion=(-0.3, 0.1, 0.0, 0.0, 0.0))
    camera.node._inputs = replace(camera.node._inputs, rectified="all")
    met = spied(camera, monkeypatch)
    camera.see(1.2, "eye", "eye")
    ((xyxy, depth),) = met
    assert xyxy.tolist() == [[100, 70, 220, 170]] and depth.shown is None and (depth.depth > 0).all()
    assert "taken as rectified" in camera.node._lens


def test_the_name_of_a_topic_behind_its_remap_states_what_is_rectified(
    made: Callable[..., Camera], monkeypatch: pytest.MonkeyPatch
) -> None:
    camera = made(distortion=(-0.3, 0.1, 0.0, 0.0, 0.0))
    monkeypatch.setattr(camera.node, "resolve_topic_name", lambda name: {"depth/image": "/cam/image_rect"}[name])
    camera.node._source = "depth/image"
    with pytest.raises(KeyError, match="image"):
        camera.node._raw_pictures()  # it asks for the name of the colour too
    names = {"depth/image": "/cam/depth/image_rect", "image": "/cam/rgb/image_raw"}
    monkeypatch.setattr(camera.node, "resolve_topic_name", names.__getitem__)
    assert camera.node._raw_pictures() == lenses.Raw(depth=False, colour=True)


def test_a_frame_of_a_lens_that_nobody_knows_is_dropped_and_counted(made: Callable[..., Camera]) -> None:
    camera = made(distortion=(0.1, 0.2, 0.3, 0.4, 0.5), model="nobody's")
    camera.see(1.2, "eye", "eye")
    assert camera.node.accounting.balance().dropped == {"malformed_depth": 1}
    (line,) = camera.said
    assert 'expected a distortion model of plumb_bob, rational_polynomial, equidistant, got "nobody\'s"' in line
    assert "set segmenter.rectified to all" in line


@pytest.mark.parametrize("made", [("-p", 'camera:="600,600,320,240,640,480"')], indirect=True)  # of twice the size
def test_the_camera_of_the_parameter_holds_and_no_camera_info_is_received(
    monkeypatch: pytest.MonkeyPatch, made: Callable[..., Camera]
) -> None:
    camera = made()
    met = spied(camera, monkeypatch)
    camera.see(1.2, "eye", "eye")
    ((_, depth),) = met
    assert camera.said == []
    intrinsics = depth.intrinsics
    assert (intrinsics.fx, intrinsics.fy, intrinsics.cx, intrinsics.cy, intrinsics.width) == (
        300,
        300,
        159.75,
        119.75,
        320,
    )
    assert "/camera_info" not in camera.node.connected and not camera.node.watch.silent()


@pytest.mark.parametrize(("z_min", "seen"), [(0.2, True), (1.5, False)])
def test_a_live_parameter_holds_from_the_next_frame_on(
    z_min: float, seen: bool, made: Callable[..., Camera], monkeypatch: pytest.MonkeyPatch
) -> None:
    camera = made()
    frames: list[Any] = []
    monkeypatch.setattr(camera.node, "_publish", lambda frame, names: frames.append(frame))
    (result,) = camera.node.set_parameters([Parameter("z_min", value=z_min)])
    assert result.successful, result.reason
    camera.see(1.2, "eye", "eye")
    (frame,) = frames
    assert bool(np.any(np.isfinite(frame.view.xyz) & (frame.view.xyz != 0))) == seen


def test_a_live_parameter_that_contradicts_another_is_refused(made: Callable[..., Camera]) -> None:
    (result,) = made().node.set_parameters([Parameter("z_min", value=9.0)])
    assert not result.successful and "z_max: expected more than z_min" in result.reason
