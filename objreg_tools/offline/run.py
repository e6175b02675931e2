# SPDX-License-Identifier: Apache-2.0
"""What came out of a run, as JSON too."""

from __future__ import annotations

from collections import Counter, defaultdict
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.closure_fields import fields_of
from objreg_ros.data.closures import LoopClosure, Rejected, Relocalised
from objreg_ros.data.frames import Frame
from objreg_ros.pipeline import Segmented
from objreg_ros.plausibility.finding import Finding
from objreg_ros.segmenter.sensor.sensor_estimate import Lag
from objreg_tools.offline.outlines import field_of_view_deg, outline
from objreg_tools.offline.stages import Registers
from objreg_tools.truth import Truth, summarise


@dataclass
class Run:
    """The results of a run."""

    frames: int = 0
    detections: int = 0
    objects: int = 0
    field_of_view_deg: tuple[float, float] | None = None  # the width and the height of its pictures
    lens: str = ""  # what was assumed of it; empty where no camera_info came
    registered: str = ""  # how depth was brought into the picture of colour; empty where it came so
    findings: tuple[Finding, ...] = ()  # where the stream is not as it says
    measured_mount: Array | None = None  # T_body_camera, where nothing says it and it was measured
    mount: str = ""  # what was assumed of how the camera sits on the body of the odometry; empty where it is known
    closures: list[LoopClosure] = field(default_factory=list)
    rejected: Counter[str] = field(default_factory=Counter)
    refusals: list[Rejected] = field(default_factory=list)
    glimpses: list[dict[str, Any]] = field(default_factory=list)  # `glimpse` of every frame
    dropped: Counter[str] = field(default_factory=Counter)  # ``malformed_<input>``, ``depth_<why>``, ``frame_<why>``
    complaints: dict[str, str] = field(default_factory=dict)  # the first of each kind
    gravity_from: Counter[str] = field(default_factory=Counter)  # segmented frames by their source of gravity
    depth_to_colour: str = ""  # how depth was turned against colour, in the end
    depth_noise: float | None = None  # in that of a Kinect v1; None where too little was measured
    depth_lag: Lag | None = None  # behind colour; None where it is not known well
    gravity_apart_deg: list[float] = field(default_factory=list)  # IMU and picture, in the frames that have both
    imu_passed_over: Counter[str] = field(default_factory=Counter)  # by reason
    stored_before: dict[str, int] = field(default_factory=dict)  # in the store, as `Store.counts`
    stored_after: dict[str, int] = field(default_factory=dict)
    relocalised: Relocalised | None = None  # the last that was known in the map of an earlier session
    relocalised_ns: int | None = None  # the stamp of the first frame of which it was known
    whereabouts: str = ""  # by what it is known in the end, or why it is not
    stage_s: dict[str, list[float]] = field(default_factory=lambda: defaultdict(list))

    def note(self, made: Segmented) -> None:
        """Note a frame as the segmenter made it."""
        self.detections += len(made.detections)
        self.objects += len(made.frame.objects)
        self.field_of_view_deg = self.field_of_view_deg or field_of_view_deg(made.frame.view.intrinsics)
        self.lens = self.lens or made.lens
        self.registered = self.registered or made.seen.registered
        self.gravity_from[made.choice.source] += 1
        if made.choice.disagreement_deg is not None:
            self.gravity_apart_deg.append(made.choice.disagreement_deg)

    def note_place(self, place: Relocalised | None) -> None:
        """Note where the newest frame is in the map of an earlier session, None where that is not known."""
        if place is not None:
            self.relocalised = place
            self.relocalised_ns = place.stamp_ns if self.relocalised_ns is None else self.relocalised_ns

    def summary(self, truth: Truth) -> dict[str, Any]:
        """The run as JSON; the keys are stable."""
        return {
            "frames": self.frames,
            "detections": self.detections,
            "objects": self.objects,
            "stream": [asdict(finding) for finding in self.findings],
            "field_of_view_deg": None if self.field_of_view_deg is None else list(self.field_of_view_deg),
            "lens": self.lens,
            "mount_estimate": None if self.measured_mount is None else {"T_body_camera": self.measured_mount.tolist()},
            "registered": self.registered,
            "depth_to_colour": self.depth_to_colour,
            "depth_noise": None if self.depth_noise is None else round(self.depth_noise, 3),
            "depth_lag": None if self.depth_lag is None else self.depth_lag._asdict(),
            "constraints": [constraint_with_error(closure, truth) for closure in self.closures],
            "rejected": dict(sorted(self.rejected.items())),
            "dropped": dict(sorted(self.dropped.items())),
            "complaints": dict(sorted(self.complaints.items())),
            "gravity": self.gravity(),
            "stored": {"before": self.stored_before, "after": self.stored_after},
            "relocalised": place_as_json(self.relocalised, self.relocalised_ns),
            "whereabouts": self.whereabouts,
            "stage_ms": {stage: percentiles_ms(seconds) for stage, seconds in self.stage_s.items()},
            "truth": summarise(truth.errors(self.closures)),
            "refusals": [fields_of(rejected) for rejected in self.refusals],
            "glimpses": self._glimpses(),
        }

    def _glimpses(self) -> list[dict[str, Any]]:
        """All frames; the outlines of those only that a constraint or a refusal names."""
        pairs: list[LoopClosure | Rejected] = [*self.closures, *self.refusals]
        named = {stamp_ns for pair in pairs for stamp_ns in (pair.from_ns, pair.to_ns)}
        return [row if row["stamp_ns"] in named else {**row, "outlines": []} for row in self.glimpses]

    def gravity(self) -> dict[str, Any]:
        """Frames by source of gravity, how far IMU and picture are apart, and what of the IMU was not used."""
        apart = np.percentile(self.gravity_apart_deg, (50, 95)).round(2).tolist() if self.gravity_apart_deg else None
        return {
            "from": dict(sorted(self.gravity_from.items())),
            "imu_and_picture_apart_deg": None if apart is None else dict(zip(("p50", "p95"), apart, strict=True)),
            "imu_passed_over": dict(sorted(self.imu_passed_over.items())),
        }


def constraint_with_error(closure: LoopClosure, truth: Truth) -> dict[str, Any]:
    """A closure as JSON, with its true ``error``: None where the truth is not known."""
    error = truth.error(closure)
    return {
        **fields_of(closure),
        "error": None if error is None else dict(zip(("rotation_deg", "translation_cm"), error, strict=True)),
    }


def glimpse(frame: Frame, labels: tuple[str, ...]) -> dict[str, Any]:
    """A frame as JSON: when, from where, what was detected, and where in the camera the middle of each object is.

    ``outlines`` are those of the objects in the picture, as `outline` makes them.
    """
    seen = [item for item in frame.objects if len(item)]
    return {
        "stamp_ns": frame.stamp_ns,
        "T_odom_camera": None if frame.T_odom_camera is None else frame.T_odom_camera.tolist(),
        "labels": list(labels),
        "objects": [[o.label, np.median(o.xyz, axis=0).astype(float).round(4).tolist()] for o in seen],
        "outlines": [outline(item.xyz, frame.view.intrinsics) for item in seen],
    }


def tracked(registrar: Registers) -> dict[str, Any] | None:
    """The camera's pose by the registrar's own tracking, as JSON: the session, and ``T_session_camera``."""
    if registrar.tracked is None:
        return None
    session, T_session_camera = registrar.tracked
    return {"session": session, "T_session_camera": T_session_camera.round(6).tolist()}


def place_as_json(place: Relocalised | None, first_ns: int | None) -> dict[str, Any] | None:
    """Where the camera is in the map of an earlier session, and since the frame of which stamp; None as it comes."""
    if place is None:
        return None
    return {
        "first_ns": first_ns,
        **{name: getattr(place, name) for name in ("stamp_ns", "session", "target_ns", "closures", "by_odometry")},
        **{name: getattr(place, name).tolist() for name in ("T_map_odom", "T_map_camera", "covariance")},
    }


def percentiles_ms(seconds: list[float]) -> dict[str, float]:
    """The median and the 95th percentile in milliseconds."""
    p50, p95 = np.percentile(seconds, (50, 95)) * 1e3
    return {"p50": round(float(p50), 3), "p95": round(float(p95), 3)}
