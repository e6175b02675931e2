# SPDX-License-Identifier: Apache-2.0
"""The segmenter: from boxes and a depth image to a frame of objects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from objreg_ros import extra
from objreg_ros.data.checked import Array
from objreg_ros.data.frames import Frame
from objreg_ros.data.images import DepthImage, Detections
from objreg_ros.segmenter.gravity.gravity_choice import GravityChoice, find_gravity
from objreg_ros.segmenter.objects import boxes
from objreg_ros.segmenter.objects.clouds import object_clouds, support_cloud
from objreg_ros.segmenter.objects.isolate import Isolated, isolate_target, taken_cells
from objreg_ros.segmenter.objects.targets import Target, read_targets
from objreg_ros.segmenter.objects.unnamed import find_unnamed
from objreg_ros.segmenter.params import SegmenterParams
from objreg_ros.segmenter.second_thread import SecondThread
from objreg_ros.segmenter.sensor.sensor_estimate import SensorEstimate
from objreg_ros.segmenter.sensor.view import reduced_view, step_for
from objreg_ros.segmenter.surface.cells import cell_size, reduce
from objreg_ros.segmenter.surface.support import COARSE, Ground, find_supports

LARGEST_BLOCK = 24 << 20  # bytes


class Segmenter:
    """Segments one frame at a time.

    Between frames it keeps ``sensor``: how noisy depth is, how it is turned against colour and how late it is, and
    ``choice``: the source of the last one's gravity.
    """

    def __init__(self, params: SegmenterParams | None = None) -> None:
        self.params = params or SegmenterParams()
        if self.params.preset == "paper":
            extra.load("open3d", "paper", "preset: paper")
        self.choice = GravityChoice(None, 0.0, "nothing")
        self._beside = SecondThread("segmenter")
        _keep_memory()
        self.sensor = SensorEstimate()

    def forget_stream(self) -> None:
        """Begin with another stream: nothing is known of its sensor."""
        self.sensor.forget_stream()

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
        params = self.params
        targets, people = read_targets(detections, masks, depth.depth.shape)
        depth = self.sensor.register(_plain(depth))
        z_min, z_max, _ = params.limits
        view = self._beside.start(reduced_view, depth, step_for(depth.intrinsics, params.view_step), z_min, z_max)
        pixels = cell_size(*depth.depth.shape)
        surface = reduce(depth.depth, depth.intrinsics, pixels, params.limits, params.jump_bounds)
        coarse = surface.every(COARSE)
        self.choice = choice = find_gravity(coarse, gravity, gravity_sigma_deg, params)
        supports = find_supports(coarse, depth.intrinsics, choice.up, params.support_area, params.jump_bounds)
        ground = Ground(choice.up, choice.confidence, supports, surface, coarse)
        found = self._isolate_all(depth, targets, ground)
        taken = taken_cells(found, ground)
        unnamed = find_unnamed(depth, ground, taken, people, params)
        return Frame(
            objects=object_clouds(targets, found, unnamed, params.min_points),
            support=support_cloud(depth, ground, taken),
            view=view.result(),
            gravity=None if choice.up is None else -choice.up,
            gravity_confidence=choice.confidence,
            T_odom_camera=None,
            stamp_ns=depth.stamp_ns,
            frame_id=depth.frame_id,
        )

    def _isolate_all(self, depth: DepthImage, targets: Sequence[Target], ground: Ground) -> list[Isolated]:
        """What each target shows, in their order; about half of the pixels on a second thread."""
        first, second = boxes.halves([target.box for target in targets])
        beside = {k: self._beside.start(isolate_target, depth, targets[k], ground, self.params) for k in second}
        found = {k: isolate_target(depth, targets[k], ground, self.params) for k in first}
        found |= {k: beside[k].result() for k in reversed(second)}
        return [found[k] for k in range(len(targets))]


def _plain(image: DepthImage) -> DepthImage:
    """``image`` with its arrays in C order, so that no kernel copies them."""
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
