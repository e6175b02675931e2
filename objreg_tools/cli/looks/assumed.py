# SPDX-License-Identifier: Apache-2.0
"""What a run of a recording assumes, row by row: a wrong assumption is the first thing to look for."""

from __future__ import annotations

from typing import Any

from objreg_ros import share
from objreg_ros.bridge.messages import camera_from_msg
from objreg_ros.detector.params import DetectorParams
from objreg_ros.detector.threshold import own_threshold
from objreg_tools.cli.recorded import Opened
from objreg_tools.offline.run import Run
from objreg_tools.recording.camera_from_text import GIVEN
from objreg_tools.recording.drift import ODOM
from objreg_tools.recording.inputs import TF_ODOM
from objreg_tools.recording.mounts import first_readable
from objreg_tools.recording.summary import describe_lens
from objreg_tools.report.run.camera_map import TRACKED

UNITS = {"16UC1": "mm", "mono16": "mm", "32FC1": "m"}
ODOMETRY = {
    None: "none, as asked for: no trajectory",
    TRACKED: "none: the registrar tracks the camera itself",
    ODOM: "synthetic, which drifts from the truth",
    TF_ODOM: "the moving frame on /tf",
}
REGISTERED = "depth is taken as registered to colour, pixel by pixel"


def assumed(opened: Opened, seen: Run) -> dict[str, str]:
    """What is assumed of a recording that is open, by name; ``seen`` is a run of it, or of its beginning."""
    source, inputs = opened.source, opened.inputs
    rows = {
        "recording": f"{source.kind}, {source.seconds:.1f} s, {opened.frames} frames",
        "colour": _topic(opened, inputs.image),
        "depth": _depth(opened),
        "registration": seen.registered or ("" if inputs.depth is None else REGISTERED),
        "camera": _camera(opened),
        "lens": seen.lens or describe_lens(source, inputs),
        "model": _model(opened),
        "odometry": _odometry(opened),
        "mount": seen.mount,
        "gravity": "what the pictures show" + (f", and {inputs.imu}" if inputs.imu else ""),
        "truth": _truth(opened),
    }
    return {name: text for name, text in rows.items() if text}


def _topic(opened: Opened, topic: str | None) -> str:
    """A topic, or the files that it is made of; empty where there is none."""
    return opened.source.made_of.get(topic or "", topic or "")


def _depth(opened: Opened) -> str:
    """Where depth comes from, and its unit."""
    inputs = opened.inputs
    if inputs.depth is None:
        return f"the cloud {inputs.points}, in m"
    if inputs.depth in opened.source.made_of:
        return _topic(opened, inputs.depth)
    first: Any = first_readable(opened.source, inputs.depth)
    encoding = str(getattr(first, "encoding", getattr(first, "format", "")))
    unit = UNITS.get(encoding.partition(";")[0], "")
    return f"{inputs.depth}, {encoding}" + (f" in {unit}" if unit else "")


def _camera(opened: Opened) -> str:
    """The numbers of the camera, and who says them."""
    topic = opened.inputs.camera_info
    info: Any = first_readable(opened.source, topic)
    if info is None:
        return "fitted to the cloud" if opened.inputs.depth is None else ""
    says = "--camera" if topic == GIVEN else _topic(opened, topic)
    try:
        camera = camera_from_msg.intrinsics(info)
    except ValueError as error:
        return f"not usable: {error}"
    numbers = " ".join(f"{name} {getattr(camera, name):.1f}" for name in ("fx", "fy", "cx", "cy"))
    return f"{camera.width} × {camera.height}, {numbers}, by {says}"


def _model(opened: Opened) -> str:
    """The detector's model, why it was taken, and from which score on it counts."""
    if opened.recorded is not None:
        return f"none: detections as recorded on {opened.recorded.topic}"
    detector = opened.asked.settings.of("detector", DetectorParams)
    model = share.model(detector.model)
    name = model.name
    if detector.model != share.AUTO:
        why = "as asked for"
    else:
        is_embedded = name == share.EMBEDDED
        why = "trained in simulation, as no other is installed" if is_embedded else "of COCO, as it is installed"
    return f"{name}, {why}; scores from {detector.threshold or own_threshold(model):g} on"


def _odometry(opened: Opened) -> str:
    known = ODOMETRY.get(opened.odometry)
    return _topic(opened, opened.odometry) if known is None else known


def _truth(opened: Opened) -> str:
    truth = opened.truth
    if not truth.poses:
        return "none: the true error of constraints is not known"
    return f"{len(truth.poses)} poses over {truth.length:.1f} m, {opened.inputs.ground_truth}"
