# SPDX-License-Identifier: Apache-2.0
"""What the stream of one camera shows of itself while it runs, beside what it says.

`follow_view` takes every view, `take_odometry` every sample of odometry. What does not fit is in `findings`. While the
camera is not what it says, `doubt` says why: no closure is to be made then. Odometry that is not this camera's is
`disowned`, and a mount that nobody knows is measured (`T_body_camera`).
"""

from __future__ import annotations

from collections import deque
from dataclasses import asdict, dataclass, field, replace
from typing import NamedTuple

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.frames import JUMP_NS, Odometry, View
from objreg_ros.data.images import Intrinsics
from objreg_ros.geometry import inverses, rotation_angle
from objreg_ros.plausibility import findings
from objreg_ros.plausibility.camera_fit import MOST_MISFIT, CameraFit, fit_camera, motions_as_stated
from objreg_ros.plausibility.corner_tracks import CornerTracks, Span
from objreg_ros.plausibility.finding import Finding
from objreg_ros.plausibility.hand_eye import HandEye, hand_eye
from objreg_ros.plausibility.odometry_fit import ALIKE, LEAST_TURNS, find_shift, likeness
from objreg_ros.plausibility.odometry_track import OdometryTrack
from objreg_ros.plausibility.offset import VAGUE_SIGMAS, Offset, offsets
from objreg_ros.plausibility.pinhole import implausible

# Deviations by which a number must be off: while looks are many; after `PATIENCE_S`; at the end, if never believed.
SIGMAS, LATER_SIGMAS, LAST_SIGMAS = 4.0, 3.0, 2.5
LEAST_SPANS, LEAST_STRANGE = 4, 6
MOST_SPANS = 48  # the newest
OFTEN, SELDOM = 12, 6  # up to so many spans each is followed by a look at all; then every so many are
STRANGE_SHARE = 0.7  # of spans that do not fit, where colour is not that of depth
PATIENCE_S, LONG_S = 20.0, 60.0  # a camera that has not moved for so long is believed; one that has not moved enough
MOST_REST = 0.8  # of the motions of one body, in the deviations of `hand_eye`; those of two come to 1 and more
WRONG_DEG = 10.0  # a mount that is off by more is wrong
ENOUGH_DEG, ENOUGH_M = 3.0, 0.12  # deviations of a mount that is measured well enough to be used
LEAST_METRES = 0.5  # that the body moved in all its spans, for a scale
STAMPS = 1000  # of frames whose mounts are remembered
GAP_SHARE, LEAST_FRAMES = 0.8, 50  # of so many frames and more, that have odometry


class _Leg(NamedTuple):
    """A span with the mounts at its start and end, None where they are unknown."""

    span: Span
    mounts: tuple[Array, Array] | None


@dataclass(slots=True, eq=False)
class StreamMonitor:
    """One for each camera."""

    camera: Intrinsics | None = None
    fit: CameraFit | None = None
    mount: HandEye | None = None
    findings: tuple[Finding, ...] = ()
    doubt: str = ""
    disowned: str = ""
    frames: int = 0
    with_odometry: int = 0
    _corners: CornerTracks = field(default_factory=CornerTracks)
    _odometry: OdometryTrack = field(default_factory=OdometryTrack)
    _legs: deque[_Leg] = field(default_factory=lambda: deque(maxlen=MOST_SPANS))
    _mounts: dict[int, Array | None] = field(default_factory=dict)
    _scale: Offset | None = None  # of depth beside odometry; None where it is not measured
    _believed: bool = False
    _sigmas: float = SIGMAS  # of the look in hand
    _spans: int = 0
    _first_ns: int = 0
    _last_ns: int | None = None
    _ahead_s: float | None = None  # by how much later odometry is stamped than the camera, as they arrive
    _frames: tuple[str, str] = ("", "")  # of the body and of the camera

    @property
    def T_body_camera(self) -> Array | None:
        """The measured mount (4, 4), for a camera whose mount nothing else says; None where it is not known well."""
        return self.mount.T_body_camera if self.mount is not None and _is_enough(self.mount) else None

    @property
    def proven(self) -> bool:
        """Whether enough was seen to believe the camera, and the scale of its depth where odometry gives that, or
        whether its motion has not shown it in a long time."""
        return self._believed or (
            not self.doubt and self._age_s > (LONG_S if self._spans >= LEAST_SPANS else PATIENCE_S)
        )

    def take_odometry(self, sample: Odometry) -> None:
        """A sample of odometry, whether or not a frame comes by it."""
        if self._last_ns is not None and self._ahead_s is None:
            self._ahead_s = 1e-9 * (sample.stamp_ns - self._last_ns)
        self._odometry.add_odometry(sample)

    def follow_view(
        self, stamp_ns: int, view: View, camera_frame: str, mount: Array | None, has_odometry: bool = False
    ) -> None:
        """The next view. ``mount`` is what is known of ``T_body_camera``, None where nothing says it."""
        if self._is_another(stamp_ns, view.intrinsics):
            self._begin_anew()
        if self.camera is None:
            self.camera, self._first_ns = view.intrinsics, stamp_ns
            self._judge_pinhole(view.intrinsics)
        self._last_ns, self._frames = stamp_ns, (self._odometry.child_frame_id, camera_frame)
        self.frames, self.with_odometry = self.frames + 1, self.with_odometry + has_odometry
        self._remember(stamp_ns, mount)
        span = self._corners.track_view(stamp_ns, view)
        if span is not None:
            mounts = self._mounts.get(span.first_ns), self._mounts.get(span.last_ns)
            self._legs.append(_Leg(span, None if mounts[0] is None or mounts[1] is None else (mounts[0], mounts[1])))
            self._spans += 1
            if self._spans <= OFTEN or self._spans % SELDOM == 0:
                self._judge()

    def judge_rest(self) -> None:
        """Judge what has come by the end of a recording."""
        if self.camera is not None and self._legs:
            self._judge(is_last=True)

    def _is_another(self, stamp_ns: int, camera: Intrinsics) -> bool:
        """Whether a view is of another camera than the one before, or of another run of the clock."""
        another = self.camera is not None and asdict(self.camera) != asdict(camera)
        return another or (self._last_ns is not None and self._last_ns - stamp_ns >= JUMP_NS)

    def _begin_anew(self) -> None:
        """Another camera, or another run of the clock."""
        self._corners, self.camera, self.fit = CornerTracks(), None, None
        self.doubt, self.disowned, self.findings = "", "", ()
        self.frames = self.with_odometry = 0
        self._scale, self._believed = None, False
        self._legs.clear()
        self._mounts.clear()
        self._spans = 0

    def _remember(self, stamp_ns: int, mount: Array | None) -> None:
        self._mounts[stamp_ns] = mount
        while len(self._mounts) > STAMPS:
            del self._mounts[next(iter(self._mounts))]

    def _judge_pinhole(self, camera: Intrinsics) -> None:
        why = implausible(camera)
        if why:
            self.findings, self.doubt = (findings.no_camera(why),), f"camera_info: {why}"

    @property
    def _age_s(self) -> float:
        return 0.0 if self._last_ns is None else 1e-9 * (self._last_ns - self._first_ns)

    def _judge(self, is_last: bool = False) -> None:
        """Look at all spans again."""
        assert self.camera is not None
        if implausible(self.camera):
            return
        later = LAST_SIGMAS if is_last and not self._believed else LATER_SIGMAS
        self._sigmas = later if is_last or self._age_s > PATIENCE_S else SIGMAS
        self.fit = fit_camera([leg.span for leg in self._legs], self.camera, self.fit)
        of_odometry, of_scale = self._of_odometry(self.fit) if len(self._odometry) > 1 else ((), ())
        doubted = (*self._of_camera(self.fit), *of_scale)
        self.doubt = doubted[0].what if doubted else ""
        self.findings = (*doubted, *of_odometry, *self._of_gaps())
        self._believed = not doubted and (self._believed or self._is_close(self.fit))

    def _is_close(self, fit: CameraFit) -> bool:
        """Whether all that is measured of the camera is surely near to what it says."""
        by_odometry = len(self._odometry) > 1 and not self.disowned
        scale = (self._scale,) if by_odometry else ()
        most_fit = fit.count >= max(LEAST_SPANS, 0.5 * len(fit.misfit))
        return most_fit and all(off is not None and off.is_close for off in (*offsets(fit), *scale))

    def _of_camera(self, fit: CameraFit) -> tuple[Finding, ...]:
        strange = float(np.mean(fit.misfit > MOST_MISFIT))
        if len(fit.misfit) >= LEAST_STRANGE and strange >= STRANGE_SHARE:
            return (findings.other_colour(strange),)
        if fit.count < LEAST_SPANS:
            return ()
        focal, *centre = offsets(fit)
        found = [findings.focal_length(fit)] if focal.is_wrong(self._sigmas) else []
        found += [findings.principal_point(fit)] if any(off.is_wrong(self._sigmas) for off in centre) else []
        return tuple(found)

    def _of_odometry(self, fit: CameraFit) -> tuple[tuple[Finding, ...], tuple[Finding, ...]]:
        """What is found of the odometry and its mount, and of the scale of depth."""
        fits = [k for k in range(len(self._legs)) if fit.misfit[k] < MOST_MISFIT]
        mounted = [k for k in fits if self._legs[k].mounts is not None]
        chosen = mounted if len(mounted) >= min(LEAST_TURNS, len(fits)) else fits
        if not chosen:
            return (), ()
        legs = [self._legs[k] for k in chosen]
        T_camera = inverses(self._motions_as_stated(legs) if _is_vague(fit) else fit.T_last_first[chosen])
        T_odom, known = self._motions(legs, 0.0)
        alike = likeness(T_odom[known], T_camera[known])
        if chosen is mounted and alike.turns < LEAST_TURNS:
            return (), self._of_few(T_odom[known], T_camera[known])
        mount = hand_eye(T_odom[known], T_camera[known]) if alike.is_alike else None
        two_bodies = alike.is_unlike or (mount is not None and mount.rest > MOST_REST)
        if known.mean() < 0.5 or two_bodies:
            return self._of_others(legs, T_camera, alike.share, two_bodies), ()
        if mount is None:
            return (), ()
        self.disowned = ""
        if chosen is mounted:
            return self._of_known_mount(mount, legs[-1], T_odom[known], T_camera[known])
        return self._of_unknown_mount(mount, T_odom[known])

    def _of_few(self, T_by_odometry: Array, T_camera: Array) -> tuple[Finding, ...]:
        """The scale by few turns, where they are those of the mount that is known."""
        alike = likeness(T_by_odometry, T_camera, np.eye(3))
        if alike.turns < LEAST_SPANS or alike.share < ALIKE:
            return ()
        return self._of_scale(hand_eye(T_by_odometry, T_camera, np.eye(4)), T_by_odometry)

    def _of_others(self, legs: list[_Leg], T_camera: Array, share: float, unlike: bool) -> tuple[Finding, ...]:
        """Odometry that does not turn as the camera does now: at another time, or never."""
        if len(legs) < LEAST_TURNS:
            return ()
        abouts = {0.0} if self._ahead_s is None or abs(self._ahead_s) < 30.0 else {0.0, self._ahead_s}
        for about_s in sorted(abouts):
            shift = find_shift(lambda seconds: self._motions(legs, seconds), T_camera, about_s)
            if shift is not None:
                found = findings.other_clock(shift.seconds, shift.likeness.share)
                self.disowned = found.what
                return (found,)
        if not unlike:
            return ()
        found = findings.other_robot(share)
        self.disowned = found.what
        return (found,)

    def _of_known_mount(
        self, beside: HandEye, last: _Leg, T_by_odometry: Array, T_camera: Array
    ) -> tuple[tuple[Finding, ...], tuple[Finding, ...]]:
        """A known mount is right where the camera's motion by odometry agrees with the motion that was seen.

        ``beside`` is how the camera sits on where the mount has it: the identity, if that is right.
        """
        degrees = float(np.degrees(rotation_angle(beside.T_body_camera[:3, :3])))
        if degrees > max(WRONG_DEG, SIGMAS * beside.rotation_sigma_deg):
            assert last.mounts is not None
            self.mount = replace(beside, T_body_camera=last.mounts[1] @ beside.T_body_camera)
            found = findings.mount_wrong(self.mount, degrees)
            self.disowned = found.what
            return (found,), ()
        return (), self._of_scale(hand_eye(T_by_odometry, T_camera, np.eye(4)), T_by_odometry)

    def _of_unknown_mount(self, fit: HandEye, T_body: Array) -> tuple[tuple[Finding, ...], tuple[Finding, ...]]:
        """A mount that nothing says is measured; the surest measurement is kept."""
        if self.mount is None or fit.rotation_sigma_deg < self.mount.rotation_sigma_deg:
            self.mount = fit
        used = self.mount if _is_enough(self.mount) else None
        finding = findings.mount_unknown(*self._frames, used, _left_open(self.mount))
        return (finding,), self._of_scale(fit, T_body)

    def _motions_as_stated(self, legs: list[_Leg]) -> Array:
        assert self.camera is not None
        return motions_as_stated([leg.span for leg in legs], self.camera)

    def _of_scale(self, fit: HandEye, T_body: Array) -> tuple[Finding, ...]:
        """Where little is known of the camera the motions are of the stated one: they prove no scale, but one that is
        surely off is that of depth, or the camera's."""
        assert self.fit is not None
        vague, scale = _is_vague(self.fit), Offset(abs(float(np.log(fit.scale))), fit.scale_sigma)
        self._scale = None if vague else scale
        metres = float(np.linalg.norm(T_body[:, :3, 3], axis=1).sum())
        sigmas = max(self._sigmas, VAGUE_SIGMAS) if vague else self._sigmas
        off = metres > LEAST_METRES and fit.rest < MOST_REST and scale.is_wrong(sigmas)
        return (findings.depth_scale(fit, or_focal=vague),) if off else ()

    def _of_gaps(self) -> tuple[Finding, ...]:
        share = self.with_odometry / self.frames
        if self.disowned or not len(self._odometry) or self.frames < LEAST_FRAMES or share >= GAP_SHARE:
            return ()
        if any(leg.mounts is None for leg in self._legs):
            return ()
        assert self._last_ns is not None
        first_ns, last_ns = self._odometry.span_ns
        covered = max(0, min(last_ns, self._last_ns) - max(first_ns, self._first_ns))
        return (findings.odometry_gaps(share, 1e-9 * covered, 1e-9 * (self._last_ns - self._first_ns)),)

    def _motions(self, legs: list[_Leg], later_s: float) -> tuple[Array, Array]:
        """The motions (n, 4, 4) by odometry from the start to the end of spans, by stamps that are so much
        later, and which of them are known: of the camera where its mount is known, else of the body."""
        ends, known = [], np.ones(len(legs), bool)
        for end in (0, 1):
            stamps_ns = np.array([leg.span[end] for leg in legs], np.int64) + round(1e9 * later_s)
            T_odom_body, there = self._odometry.at(stamps_ns)
            ends.append(T_odom_body @ np.array([np.eye(4) if leg.mounts is None else leg.mounts[end] for leg in legs]))
            known &= there
        return inverses(ends[0]) @ ends[1], known


def _is_vague(fit: CameraFit) -> bool:
    """Whether little is known of a camera."""
    return any(offset.is_vague for offset in offsets(fit))


def _is_enough(mount: HandEye) -> bool:
    """Whether a measured mount may be used: its rotation is known, and all but one direction of its position."""
    return mount.rotation_sigma_deg <= ENOUGH_DEG and float(np.sort(mount.lever_sigma_m)[1]) <= ENOUGH_M


def _left_open(mount: HandEye) -> str:
    """A description of what the motion does not show of a mount."""
    axes = [axis for axis, sigma in zip("xyz", mount.lever_sigma_m, strict=True) if sigma > ENOUGH_M]
    return f"; its {' and '.join(axes)} cannot be seen from such motion and is near 0" if axes else ""
