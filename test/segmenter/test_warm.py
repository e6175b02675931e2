# SPDX-License-Identifier: Apache-2.0
"""Warming up reaches every kernel in every form: no frame that comes later compiles anything."""

from __future__ import annotations

import importlib
import pkgutil
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context

import numpy as np
from numba.core.registry import CPUDispatcher

import objreg_ros.segmenter
from objreg_ros.data.images import DepthImage, Detections
from objreg_ros.segmenter.segment import Segmenter

from .scenes import CAMERA, SMALL, Scene

Forms = dict[str, list[str]]


def compiled_forms() -> Forms:
    """The signatures for which each kernel of the segmenter is compiled in this process."""
    found = {}
    for module in pkgutil.walk_packages(objreg_ros.segmenter.__path__, "objreg_ros.segmenter."):
        if module.name != "objreg_ros.segmenter.node":
            for name, kernel in vars(importlib.import_module(module.name)).items():
                if isinstance(kernel, CPUDispatcher):
                    found[f"{module.name}.{name}"] = sorted(map(str, kernel.signatures))
    return found


def cluttered(camera: object = CAMERA) -> Scene:
    """A bowl-like ring, a stack, things cut by the image and a shelf."""
    scene = Scene(camera, tilt_deg=45).plane().box((-0.25, -0.05, 0), (-0.1, 0.1, 0.1))
    scene = scene.box((0.05, -0.1, 0), (0.3, 0.1, 0.06)).box((0.1, -0.05, 0.06), (0.2, 0.05, 0.15))
    return scene.box((-0.9, 0.1, 0), (-0.45, 0.3, 0.3)).box((0.4, 0.3, 0.25), (0.9, 0.6, 0.27))


def frames() -> list[tuple[Detections, DepthImage]]:
    """Images of several sizes and memory layouts, with boxes up to the whole image."""
    found = []
    for camera in (CAMERA, SMALL):
        scene = cluttered(camera)
        image = scene.image(0.0015)
        whole = (0.0, 0.0, float(camera.width), float(camera.height))
        asked = scene.detections(*(scene.box_of(k) for k in range(2, 7)), whole, (0.0, 90.0, whole[2], 200.0))
        mirrored = None if image.rgb is None else image.rgb[..., ::-1]
        loose = np.asfortranarray(image.depth)
        found += [(asked, image), (asked, replace(image, rgb=None)), (asked, replace(image, rgb=mirrored))]
        found += [(asked, replace(image, depth=loose)), (asked, replace(image, depth=np.zeros_like(image.depth)))]
    return found


def forms_before_and_after() -> tuple[Forms, Forms]:
    segmenter = Segmenter()
    segmenter.warm()
    before = compiled_forms()
    for asked, image in frames():
        segmenter.segment(asked, image)
        segmenter.segment(asked, image, gravity=np.array([0.0, 1.0, 0.5]))
    return before, compiled_forms()


def test_no_frame_after_warming_up_compiles_anything() -> None:
    with ProcessPoolExecutor(1, get_context("spawn")) as pool:  # a process in which nothing is compiled yet
        before, after = pool.submit(forms_before_and_after).result()
    assert sum(map(len, before.values())) > 20
    assert after == before
