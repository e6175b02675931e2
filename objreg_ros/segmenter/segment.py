# SPDX-License-Identifier: Apache-2.0
"""The segmenter: from boxes and a depth image to a frame of objects."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from typing import Any

import numpy as np

from objreg_ros import extra, limits
from objreg_ros.data.checked import Array
from objreg_ros.data.frames import UNNAMED, Frame, ObjectCloud, PointFlag
from objreg_ros.data.images import DepthImage, Detections, Intrinsics
from objreg_ros.segmenter.gravity.gravity_choice import GravityChoice, choose_gravity
from objreg_ros.segmenter.gravity.level_surfaces import camera_up, estimate_up, known_normals
from objreg_ros.segmenter.objects import boxes, paper
from objreg_ros.segmenter.objects.boxes import NOTHING, Box
from objreg_ros.segmenter.objects.extract import Pixels, cell_points, colours
from objreg_ros.segmenter.objects.isolate import Isolated, Outline, cut_out, isolate, mark
from objreg_ros.segmenter.objects.unnamed import PERSON, find_unnamed
from objreg_ros.segmenter.params import SegmenterParams
from objreg_ros.segmenter.sensor.depth_to_colour import warm as warm_offset
from objreg_ros.segmenter.sensor.sensor_estimate import SensorEstimate
from objreg_ros.segmenter.sensor.view import reduced_view, step_for
from objreg_ros.segmenter.surface.cells import Surface, cell_size, reduce
from objreg_ros.segmenter.surface.support import Ground, find_supports

COARSE = 2  # every so many cells are used for gravity and the support surfaces
WARM_SIZES = ((640, 480), (320, 240))  # two and one pixel a cell: each has a kernel of its own
LARGEST_BLOCK = 24 << 20  # bytes
NORMALS = 3  # every so many of these are used for gravity


class Segmenter:
    """Segments one frame at a time.

    Between frames it keeps ``sensor``: how noisy depth is, how it is turned against colour and how late it is, and
    ``choice``: the source of the last one's gravity.

    A second thread takes half of the boxes: the kernels let go of the interpreter's lock.
    """

    def __init__(self, params: SegmenterParams | None = None) -> None:
        self.params = params or SegmenterParams()
        if self.params.preset == "paper":
            extra.load("open3d", "paper", "preset: paper")
        self.choice = GravityChoice(None, 0.0, "nothing")
        self._beside = ThreadPoolExecutor(1, "segmenter")
        self.sensor = SensorEstimate()

    def warm(self) -> None:
        """Compile or load every kernel and claim memory, so that the first frame is as fast as the others."""
        _keep_memory()
        for width, height in WARM_SIZES:
            camera = Intrinsics(
                fx=float(width), fy=float(width), cx=width / 2, cy=height / 2, width=width, height=height
            )
            colour = np.zeros((height, width, 3), np.uint8)
            image = DepthImage(depth=_block_on_table(camera), rgb=colour, intrinsics=camera, stamp_ns=0)
            block = np.array([[0.3, 0.25, 0.7, 0.75]], np.float32) * (width, height, width, height)
            asked = Detections(
                xyxy=block.astype(np.float32),
                score=np.ones(1, np.float32),
                label=("",),
                image_hw=(height, width),
                stamp_ns=0,
            )
            self.segment(asked, image)
            warm_offset(image)
        self.forget()

    def forget(self) -> None:
        """Begin with another stream: nothing is known of its sensor."""
        self.sensor.forget()

    def segment(
        self,
        detections: Detections,
        depth: DepthImage,
        gravity: Array | None = None,
        masks: Sequence[Array | None] | None = None,
        gravity_sigma_deg: float | None = None,
    ) -> Frame:
        """The objects of one frame, in the order of their boxes; stamp and frame_id are those of ``depth``.

        Boxes of a picture of another size are scaled by ``detections.image_hw`` to the depth image, which must show
        the same field of view. ``gravity (3,)`` is its direction in the camera frame where an odometry or an IMU
        knows it. With ``gravity_sigma_deg``, the standard deviation of its tilts, it is handed on where it is surer
        than what the frame shows; without, in any case and with confidence 1. Where there is none it is estimated from
        the frame. A box without an object of `min_points` gives none, and so does that of a person, who is no part of a
        place; instances count the objects from 1.
        Objects without a name come last, with `UNNAMED` for a label, where the parameter `unnamed` asks for them.
        ``T_odom_camera`` is None.

        What a mask covers is the object, instead of what stands in the box: that of ``detections.instances``, or of
        ``masks``, which has for each box a mask (H, W) bool of the depth image, or None. ValueError for masks of
        another number, type or shape.
        """
        params, outlines = self.params, _outlines(masks, detections, depth)
        depth = self.sensor.register(_plain(depth))
        seen = (depth, step_for(depth.intrinsics, params.view_step), params.z_min, params.limits[0])
        view = self._beside.submit(reduced_view, *seen)
        ground = self._ground(depth, gravity, gravity_sigma_deg)
        taken = np.zeros(ground.surface.depth.shape, np.bool_)
        asked = boxes.pixel_boxes(detections, *depth.depth.shape)
        people = [box for box, label in zip(asked, detections.label, strict=True) if label == PERSON]
        placed = [NOTHING if label == PERSON else box for box, label in zip(asked, detections.label, strict=True)]
        found = self._cut_all(depth, placed, outlines, ground)
        objects: list[ObjectCloud] = []
        for k in sorted(found):
            cut = found[k]
            if cut.cells is not None:
                mark(taken, cut.cells, ground)
            if len(cut.pixels) >= params.min_points:
                label, score = detections.label[k], float(detections.score[k])
                name = detections.ids[k] if detections.ids else ""
                objects.append(_object(label, score, len(objects) + 1, cut.pixels, cut.flags, name))
        objects += self._unnamed(depth, ground, taken, people, len(objects))
        return Frame(
            objects=tuple(objects),
            support=_support_cloud(ground, taken, depth),
            view=_result(view, reduced_view, *seen),
            gravity=None if ground.up is None else -ground.up,
            gravity_confidence=ground.confidence,
            T_odom_camera=None,
            stamp_ns=depth.stamp_ns,
            frame_id=depth.frame_id,
        )

    def _unnamed(
        self, depth: DepthImage, ground: Ground, taken: Array, people: list[Box], named: int
    ) -> list[ObjectCloud]:
        """The objects without a name, counted from behind the ``named`` ones."""
        if not self.params.unnamed or self.params.preset == "paper":
            return []
        found = find_unnamed(depth, ground, taken, people, self.params)[: limits.MOST_OBJECTS - named]
        return [_object(UNNAMED, one.own, named + k, one.pixels, one.flags) for k, one in enumerate(found, start=1)]

    def _cut_all(
        self, depth: DepthImage, asked: list[Box], outlines: Sequence[Outline | None], ground: Ground
    ) -> dict[int, Isolated]:
        """What each box that is not empty shows, by its number; about half of the pixels on a second thread."""
        first, second = boxes.halves(asked)
        beside = {k: self._beside.submit(self._cut, depth, asked[k], outlines[k], ground) for k in second}
        found = {k: self._cut(depth, asked[k], outlines[k], ground) for k in first}
        for k in reversed(second):
            found[k] = _result(beside[k], self._cut, depth, asked[k], outlines[k], ground)
        return found

    def _cut(self, depth: DepthImage, box: Box, outline: Outline | None, ground: Ground) -> Isolated:
        if outline is not None:
            return cut_out(depth, box, outline, ground, self.params)
        if self.params.preset == "paper":
            return Isolated(paper.cut(depth, box, self.params), PointFlag(0), None)
        return isolate(depth, box, ground, self.params)

    def _ground(self, depth: DepthImage, gravity: Array | None, sigma_deg: float | None) -> Ground:
        params = self.params
        z_max, y_max = params.limits
        limits, jump = (params.z_min, z_max, y_max), (params.jump, params.jump_z2)
        surface = reduce(depth.depth, depth.intrinsics, cell_size(*depth.depth.shape), limits, jump)
        coarse = surface.every(COARSE)
        self.choice = _choice(coarse, gravity, sigma_deg, params)
        up, confidence = self.choice.up, self.choice.confidence
        supports = [] if up is None else find_supports(coarse, depth.intrinsics, up, params.support_area, jump)
        return Ground(up, confidence, supports, surface, coarse)


def _outlines(
    masks: Sequence[Array | None] | None, detections: Detections, depth: DepthImage
) -> Sequence[Outline | None]:
    """The outline of each box, or None; ValueError for masks of another number or another shape."""
    count = len(detections)
    if masks is None:
        numbers = detections.instances_at(depth.depth.shape)
        return [None if numbers is None else Outline(numbers, k + 1) for k in range(count)]
    if len(masks) != count:
        raise ValueError(f"masks: expected one or None for each of {count} boxes, got {len(masks)}")
    for mask in masks:
        if mask is not None and (mask.dtype != np.bool_ or mask.shape != depth.depth.shape):
            raise ValueError(f"mask: expected bool of shape {depth.depth.shape}, got {mask.dtype} of {mask.shape}")
    return [None if mask is None else Outline(mask) for mask in masks]


def _result(beside: Future[Any], work: Callable[..., Any], *inputs: Any) -> Any:
    """What the second thread finds by ``work(*inputs)``; done here if it has not begun, as where all cores are busy."""
    return work(*inputs) if beside.cancel() else beside.result()


def _plain(image: DepthImage) -> DepthImage:
    """``image`` with arrays in the one memory layout that the kernels are compiled for."""
    depth = np.require(image.depth, requirements=("C", "A"))
    rgb = None if image.rgb is None else np.require(image.rgb, requirements=("C", "A"))
    return image if depth is image.depth and rgb is image.rgb else replace(image, depth=depth, rgb=rgb)


def _keep_memory() -> None:
    """Let the allocator keep what a frame frees for the next one.

    Page faults on memory given back between frames take milliseconds of each. The GNU C library raises the size of
    what it gives back at once to that of the largest block it has seen freed, and trims its heap at twice that
    (mallopt(3), M_MMAP_THRESHOLD); the block is never touched, so it costs nothing. Elsewhere this does nothing.
    """
    np.empty(LARGEST_BLOCK, np.uint8)


def _block_on_table(camera: Intrinsics) -> Array:
    """Depth of a level surface seen from a metre above at half a right angle, with a block on it that has a pit."""
    y = (np.arange(camera.height, dtype=np.float32)[:, None] - camera.cy) / camera.fy
    depth = np.repeat(np.sqrt(2.0) / (1.0 + np.maximum(y, -0.6)), camera.width, axis=1).astype(np.float32)
    h, w = camera.height // 8, camera.width // 8
    depth[3 * h : 5 * h, 3 * w : 5 * w] *= 0.8
    depth[4 * h : 4 * h + h // 4, 4 * w : 4 * w + w // 4] *= 1.1
    return depth


def _choice(surface: Surface, gravity: Array | None, sigma_deg: float | None, params: SegmenterParams) -> GravityChoice:
    up = None if gravity is None else -_direction(gravity)
    if up is not None and sigma_deg is None:
        return GravityChoice(up, 1.0, "odom")
    seen, confidence = estimate_up(known_normals(surface.normals, NORMALS), camera_up(params.roll), params.up_tilt)
    if up is not None and sigma_deg is not None:
        return choose_gravity(up, sigma_deg, seen, confidence)
    return GravityChoice(seen, confidence, "nothing" if seen is None else "picture")


def _direction(gravity: Array) -> Array:
    length = float(np.linalg.norm(gravity))
    if not np.isfinite(length) or length < 1e-6:
        raise ValueError(f"gravity: expected a direction of non-zero length, got {np.asarray(gravity).tolist()}")
    return np.asarray(gravity, np.float64) / length


def _object(
    label: str, score: float, instance: int, pixels: Pixels, flags: PointFlag, detection_id: str = ""
) -> ObjectCloud:
    return ObjectCloud(
        label=label,
        score=score,
        instance=instance,
        xyz=pixels.xyz,
        normals=pixels.normals,
        rgb=pixels.rgb,
        flags=pixels.edge | np.uint16(flags),
        density=len(pixels) / max(pixels.area, 1e-9),
        detection_id=detection_id,
    )


def _support_cloud(ground: Ground, taken: Array, depth: DepthImage) -> ObjectCloud | None:
    """The coarse cells of the support surfaces that are of no object, one point each; None where there are none."""
    if not ground.supports:
        return None
    cells = ground.supports[0].parts > 0
    for support in ground.supports[1:]:
        cells |= support.parts > 0
    cells &= ~taken[::COARSE, ::COARSE]
    xyz, normals, rgb = cell_points(ground.coarse, cells, colours(depth))
    if len(xyz) == 0:
        return None
    area = sum(support.area for support in ground.supports)
    return ObjectCloud(
        label="support",
        score=1.0,
        instance=0,
        xyz=xyz,
        normals=normals,
        rgb=None if depth.rgb is None else rgb,
        flags=np.zeros(len(xyz), np.uint16),
        density=len(xyz) / max(area, 1e-9),
    )
