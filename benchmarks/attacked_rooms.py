# SPDX-License-Identifier: Apache-2.0
"""The stages under attack: what decodes is handed on to detector, segmenter, registrar and map.

A stage may refuse a message with ValueError or OSError. A crash of a kernel ends the process, which `trials` counts.
"""

from __future__ import annotations

import random
from collections.abc import Iterator
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from attacked_messages import (
    NAMES,
    SECOND,
    _encoded,
    _encoded_depth,
    clouds,
    colour_image,
    constraint_message,
    depth_image,
    drawn_frame,
    frame_messages,
    odometry_message,
    trial,
    two_detections,
    written,
)
from mutation import mutated
from trials import Attempt, Target, WrongAnswerError

from objreg_mapper.optimisation.incremental import load
from objreg_mapper.pose_graph import PoseGraph
from objreg_ros import share
from objreg_ros.bridge.messages import camera_from_msg, from_msg, motion_from_msg, to_msg
from objreg_ros.data.frames import Frame
from objreg_ros.data.images import DepthImage, Detections, Intrinsics
from objreg_ros.detector.detector import Detector
from objreg_ros.detector.params import DetectorParams
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registrar.registrar import Registrar
from objreg_ros.segmenter.params import SegmenterParams
from objreg_ros.segmenter.segment import Segmenter
from objreg_ros.segmenter.sensor.doubts import range_doubt, registration_doubt
from objreg_ros.segmenter.sensor.organise import organise

CAMERA = Intrinsics(fx=70.0, fy=70.0, cx=39.5, cy=29.5, width=80, height=60)
GAP_NS = 3 * SECOND
ROUND = 24  # poses of the odometry that a map is made of


def detect_attempt(_: Path) -> Attempt:
    """An image through the project's own model."""
    detector = Detector.of(DetectorParams(model=share.EMBEDDED, threads=1, threshold=0.01), share.model)
    names = dict(enumerate(detector.labels))

    def use(message: Any) -> None:
        found = detector.detect(from_msg.image(message))
        written(to_msg.detections_table(found, names), found.stamp_ns)

    return partial(trial, [(message,) for message in _encoded(colour_image(camera=CAMERA))], use)


def segment_attempt(_: Path) -> Attempt:
    """Depth or a cloud, detections and labels through the segmenter."""
    segmenter = Segmenter(SegmenterParams())
    image = depth_image(camera=CAMERA)
    info = to_msg.camera_info(CAMERA, SECOND, "camera")
    colour = to_msg.image(colour_image(camera=CAMERA))
    rest = to_msg.detections_table(two_detections(camera=CAMERA), NAMES), to_msg.labels(NAMES)
    pictures = [(depth, info, colour, *rest) for depth in _encoded_depth(image)]
    points = [(cloud, info, colour, *rest) for cloud in clouds(image)]

    def use(depth: Any, camera: Any, picture: Any, boxes: Any, said: Any) -> None:
        names = from_msg.labels(said)
        seen = _depth(depth, camera, picture)
        detections = from_msg.detections(boxes, names, seen.depth.shape)
        _segment(segmenter, detections, seen, names)

    return partial(trial, [*pictures, *points], use)


def _depth(message: Any, info: Any, colour: Any) -> DepthImage:
    """As the segmenter's node reads either source."""
    if not hasattr(message, "point_step"):
        return from_msg.depth_image(message, info, colour)
    cloud = from_msg.point_cloud(message)
    return organise(cloud, camera_from_msg.camera_of_cloud(info, cloud))


def _segment(segmenter: Segmenter, detections: Detections, depth: DepthImage, names: dict[int, str]) -> None:
    frame = segmenter.segment(detections, depth, None)
    registration_doubt(detections, depth)
    range_doubt(depth, frame.view, segmenter.params)
    parts = to_msg.objects(frame, names), to_msg.view(frame), to_msg.view_camera_info(frame), to_msg.gravity(frame)
    objects, view, info, gravity = (written(part, frame.stamp_ns) for part in parts)
    try:
        from_msg.frame(objects, view, info, gravity, names)
    except ValueError as error:
        raise WrongAnswerError(f"the registrar refuses what the segmenter said: {error}") from error


def register_attempt(_: Path) -> Attempt:
    """Frames through a registrar: the same place twice, one time or both spoilt."""
    params = RegistrarParams(threads=1, min_gap=1.0)
    goods = [
        (frame_messages(drawn_frame(k, step)), frame_messages(drawn_frame(k, step))) for k, step in ((0, 2), (0, 4))
    ]

    def attempt(draw: random.Random) -> None:
        pair = draw.choice(goods)
        frames = [_read(draw, messages, n) for n, messages in enumerate(pair)]
        with closing(Registrar(params)) as registrar:
            for n, frame in enumerate(frames):
                _follow(registrar, frame, n)

    return attempt


def _read(draw: random.Random, messages: tuple[Any, ...], n: int) -> Frame:
    made = list(messages)
    for k in (draw.randrange(4) for _ in range(draw.choice((0, 1, 1, 2)))):
        made[k] = mutated(draw, made[k])
    for message in made[:4]:
        message.header.stamp = to_msg.stamp(n * GAP_NS)
    for message in messages[:4]:  # what was not spoilt is used again
        message.header.stamp = to_msg.stamp(n * GAP_NS)
    objects, view, info, gravity, said = made
    return from_msg.frame(objects, view, info, gravity, from_msg.labels(said))


def _follow(registrar: Registrar, frame: Frame, n: int) -> None:
    """Process a frame as a keyframe of its own, and write what comes of it."""
    outcomes = registrar.process(frame), registrar.finish()
    for outcome in outcomes:
        for closure in outcome.closures:
            written(to_msg.constraint(closure), closure.to_ns)
        if outcome.keyframe_ns is not None:
            written(to_msg.landmarks(outcome.observations, outcome.keyframe_ns, outcome.frame_id, NAMES))


def map_attempt(_: Path) -> Attempt:
    """Spoilt odometry and constraints into a map; good ones must still solve it."""
    load()
    way = [odometry_message((1 + k) * SECOND, 0.3 * k) for k in range(ROUND)]
    ties = [constraint_message((1 + k) * SECOND, (9 + k) * SECOND, 2.4) for k in range(0, ROUND - 9, 3)]

    def attempt(draw: random.Random) -> None:
        graph, spoilt_way = PoseGraph(), draw.randrange(ROUND)
        for k, message in enumerate(way):
            if k == spoilt_way and draw.random() < 0.5:
                message = _with_stamp(mutated(draw, message), (1 + k) * SECOND)
            for odometry in _readable(motion_from_msg.odometry, message):
                graph.add_odometry(odometry)
        for message in (mutated(draw, draw.choice(ties)), ties[0], mutated(draw, draw.choice(ties)), ties[-1]):
            for closure in _readable(from_msg.loop_closure, message):
                _tie(graph, closure)
            _solve(graph)

    return attempt


def _with_stamp(message: Any, stamp_ns: int) -> Any:
    message.header.stamp = to_msg.stamp(stamp_ns)
    return message


def _readable(decode: Any, message: Any) -> Iterator[Any]:
    try:
        yield decode(message)
    except ValueError:
        return


def _tie(graph: PoseGraph, closure: Any) -> None:
    try:
        graph.add_closure(closure)
    except ValueError:
        return


def _solve(graph: PoseGraph) -> None:
    """What the map says must be numbers, whatever was in it."""
    try:
        graph.optimise()
        poses = [graph.T_map_odom, *(T for _, T in graph.path())]
    except ValueError as error:
        raise WrongAnswerError(f"a solution fails: {error}") from error
    if not np.isfinite(np.array(poses)).all():
        raise WrongAnswerError("a pose of the map is no number")
    written(to_msg.path(graph.path(), SECOND, "map"))


TARGETS = [
    Target("detect", detect_attempt, 0.5),
    Target("segment", segment_attempt, 1.0),
    Target("register", register_attempt, 2.0),
    Target("map", map_attempt, 0.5),
]
