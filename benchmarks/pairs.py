# SPDX-License-Identifier: Apache-2.0
"""Registration of pairs of real frames, judged by the recording's true poses, beside the usual methods in the same run.

A pair could close when both frames show an object at one place; it could not when they share a label but no object,
and see next to nothing of each other. The moments lie 2 s apart or more. Errors are of the camera's pose: strict is 3
degrees and 5 cm, loose 5 degrees and 10 cm, wrong is beyond 8 degrees or 15 cm. With ``--lag-ms`` poses that are wrong
at every lag of the truth up to that are counted beside those that are wrong at the stamps.

    python benchmarks/pairs.py REC --json pairs.json --pictures failures/
    python benchmarks/pairs.py REC --every 25 --peers ""                          # as if the camera took stills
    python benchmarks/pairs.py REC --every 25 --peers "" --unregistered           # its depth not brought upon colour
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import click
import cv2
import numpy as np
from command_line import quick_values
from frame_pairs import Pair, Truths, draw_pairs
from pair_figures import Row, figures, line
from pair_pictures import draw_failures
from peers import PEERS, Answer, Peer, Shot, named
from sources import Reading, Source, detector_of, read_source

from objreg_ros.data.checked import Array
from objreg_ros.data.closures import Reason
from objreg_ros.data.frames import Frame
from objreg_ros.geometry import back_project, pose_error
from objreg_ros.keyframes.frame_window import FrameWindow
from objreg_ros.keyframes.fusion import fuse
from objreg_ros.keyframes.keyframer import Keyframer
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registration.candidate import Candidate
from objreg_ros.registration.engine import Engine
from objreg_ros.registration.gate.verdict import judge
from objreg_ros.registration.keyframe import Keyframe
from objreg_ros.registration.score.view_score import LEAST_SCORE, verify
from objreg_tools.truth import Truth

QUICK = {"wanted": 15, "names": ("paper", "orb_pnp")}
LAG_STEP_MS = 10
LEAST_TESTED = 600  # pixels that both views see under a peer's pose, to be accepted by them
GICP_VOXEL = 0.03  # m, of the whole frames that finish a peer's pose


def fused(frames: Sequence[Frame], params: RegistrarParams) -> list[Keyframe]:
    """The keyframes that the registrar would make of a recording."""
    keyframer = Keyframer(params)
    windows = [keyframer.add_frame(frame) for frame in frames] + [keyframer.finish_window()]
    return [fuse(window, params) for window in windows if window is not None]


class Ours:
    """The engine and the gate."""

    def __init__(self, keyframes: Sequence[Keyframe], params: RegistrarParams) -> None:
        self._keyframes = keyframes
        self.engine = Engine(params)

    def __call__(self, pair: Pair) -> Row:
        """The accepted candidate, or the best one and the reason for refusing it."""
        start = time.perf_counter()
        candidates = self.engine.propose(self._keyframes[pair.source], self._keyframes[pair.target])
        verdict = judge(candidates)
        ms = 1e3 * (time.perf_counter() - start)
        if isinstance(verdict, Candidate):
            return _row(verdict.T_target_source, True, ms, pair)
        reason: Reason = verdict[0]
        best = candidates[0].T_target_source if candidates else None
        return _row(best, False, ms, pair, reason.value)


class Theirs:
    """A peer on the same frames at full size; what it prepares of a frame is kept, and not timed."""

    def __init__(self, peer: Peer, shots: Callable[[int], Shot]) -> None:
        self._peer, self._shots = peer, shots
        self._prepared: dict[int, Any] = {}

    def __call__(self, pair: Pair) -> Row:
        """The peer's answer."""
        first, second = (self._ready(k) for k in (pair.target, pair.source))
        start = time.perf_counter()
        answer = self._peer.register(first, second)
        ms = 1e3 * (time.perf_counter() - start)
        return Row(None, False, ms, "no pose") if answer is None else _row(*answer, ms, pair)

    def _ready(self, index: int) -> Any:
        if index not in self._prepared:
            self._prepared[index] = self._peer.prepare(self._shots(index))
        return self._prepared[index]


class Finished:
    """A peer whose pose is finished by GICP on the whole frames, at the same acceptance."""

    def __init__(self, peer: Peer) -> None:
        self.name, self._peer = f"{peer.name}+gicp", peer

    def prepare(self, shot: Shot) -> Any:
        """What the peer prepares, and a cloud for GICP."""
        import small_gicp

        camera, depth = shot.image.intrinsics, shot.image.depth
        xyz = back_project(depth, camera.fx, camera.fy, camera.cx, camera.cy)[(depth > 0) & (depth < 4.0)]
        return self._peer.prepare(shot), small_gicp.preprocess_points(xyz.astype(np.float64), GICP_VOXEL, 12, 1)

    def register(self, first: Any, second: Any) -> Answer | None:
        """The peer's pose after two rounds of GICP."""
        import small_gicp

        answer = self._peer.register(first[0], second[0])
        if answer is None or np.linalg.norm(answer.T_from_to[:3, 3]) > 10.0:
            return None
        T = answer.T_from_to
        for reach in (0.08, 0.05):
            T = small_gicp.align(
                first[1][0], second[1][0], first[1][1], T,
                registration_type="GICP", max_correspondence_distance=reach, num_threads=1,
            ).T_target_source  # fmt: skip
        return Answer(np.asarray(T), answer.accepted)


class Checked:
    """Another method, accepted by our look at the whole views instead of by its own test."""

    def __init__(self, method: Callable[[Pair], Row], truths: Truths) -> None:
        self._method, self._truths = method, truths

    def __call__(self, pair: Pair) -> Row:
        """The method's pose; accepted if the views agree in more than next to nothing."""
        row = self._method(pair)
        if row.T is None:
            return row
        source, target = self._truths.sight(pair.source), self._truths.sight(pair.target)  # made once, so not timed
        start = time.perf_counter()
        seen = verify(source, target, row.T)
        ms = row.ms + 1e3 * (time.perf_counter() - start)
        accepted = seen.score >= LEAST_SCORE and seen.tested >= LEAST_TESTED
        return replace(row, accepted=accepted, ms=ms, reason="" if accepted else "views")


def _row(T: Array | None, accepted: bool, ms: float, pair: Pair, reason: str = "") -> Row:
    if T is None or not np.isfinite(T).all():
        return Row(None, False, ms, reason)
    lagged = tuple(pose_error(T, true) for true in pair.lagged)
    return Row(pose_error(T, pair.T_target_source), accepted, ms, reason, np.asarray(T), lagged)


def methods_of(
    source: Source, keyframes: Sequence[Keyframe], truths: Truths, params: RegistrarParams, names: Sequence[str]
) -> dict[str, Callable[[Pair], Row]]:
    """The methods to compare, ours first."""
    frames = {frame.stamp_ns: frame for frame in source.frames}

    def shot(index: int) -> Shot:
        return source.shot(frames[keyframes[index].stamp_ns])

    methods: dict[str, Callable[[Pair], Row]] = {"ours": Ours(keyframes, params)}
    for peer in (PEERS[name]() for name in names):
        methods[peer.name] = Theirs(peer, shot)
        if peer.name in ("sift_pnp", "fpfh_icp"):
            finished = Finished(peer)
            methods[finished.name] = Theirs(finished, shot)
            methods[f"{finished.name}+our views"] = Checked(Theirs(finished, shot), truths)
    return methods


def lagged_poses(truth: Truth, keyframes: Sequence[Keyframe], lag_ms: int) -> list[Array]:
    """The true poses of what was seen ``lag_ms`` before the stamps; at the stamps where the truth has no others."""
    found = []
    for keyframe in keyframes:
        T = truth.at(keyframe.stamp_ns - 1_000_000 * lag_ms)
        at_stamp = truth.at(keyframe.stamp_ns)
        assert at_stamp is not None
        found.append(at_stamp if T is None else T)
    return found


def compare(source: Source, params: RegistrarParams, options: dict[str, Any]) -> dict[str, Any]:
    """All methods over the same pairs of one recording."""
    frames = [frame for frame in source.frames if source.truth.at(frame.stamp_ns) is not None]
    makes = fused(frames, params) if options["keyframes"] else [fuse(FrameWindow.of(frame), params) for frame in frames]
    keyframes = [keyframe for keyframe in makes if keyframe.objects]
    poses = [source.truth.at(keyframe.stamp_ns) for keyframe in keyframes]
    lagged = [lagged_poses(source.truth, keyframes, lag_ms) for lag_ms in options["lags_ms"]]
    truths = Truths(keyframes, [T for T in poses if T is not None], params, lagged)
    pairs = draw_pairs(truths, len(keyframes), options["wanted"], options["seed"])
    out: dict[str, Any] = {"keyframes": len(keyframes), "pairs": len(pairs), "methods": {}}
    for name, method in methods_of(source, keyframes, truths, params, options["peers"]).items():
        if pairs:
            method(pairs[0])  # compiled kernels and caches before the clock
        rows = [method(pair) for pair in pairs]
        out["methods"][name] = figures(pairs, rows, len(keyframes) // 2)
        click.echo(line(name, out["methods"][name]))
        if name == "ours" and options["pictures"]:
            image = lambda k: source.album.at(keyframes[k].stamp_ns)  # noqa: E731
            draw_failures(options["pictures"], pairs, rows, image)
    return out


@click.command()
@click.argument("recording", type=click.Path(exists=True, path_type=Path))
@click.option("--json", "json_file", type=click.Path(dir_okay=False, path_type=Path), help="Write the figures here.")
@click.option("--keyframes", is_flag=True, help="Fused keyframes instead of single frames.")
@click.option("--quick", is_flag=True, help="Few pairs, ours and two peers.")
@click.option("--wanted", default=200, show_default=True, help="Pairs of each kind.")
@click.option("--model", default="", help="ONNX model; empty: the default one.")
@click.option("--threshold", default=0.5, show_default=True, help="Least score of a detection; COCO models want 0.4.")
@click.option(
    "--peers", "names", default="paper,orb_pnp,sift_pnp,fpfh_icp", show_default=True, callback=named, help="Methods."
)
@click.option("--pictures", type=click.Path(file_okay=False, path_type=Path), help="Draw the worst failures here.")
@click.option("--lag-ms", default=0, show_default=True, help="Most that what is seen may be behind its stamp.")
@click.option("--every", type=click.IntRange(min=1), default=1, show_default=True, help="As stills: every N-th frame.")
@click.option("--unregistered", is_flag=True, help="Leave depth beside colour as it comes.")
@click.option("--seed", default=1, show_default=True)
@click.pass_context
def main(
    context: click.Context,
    recording: Path,
    json_file: Path | None,
    keyframes: bool,
    quick: bool,
    wanted: int,
    model: str,
    threshold: float,
    names: tuple[str, ...],
    pictures: Path | None,
    lag_ms: int,
    every: int,
    unregistered: bool,
    seed: int,
) -> None:
    """Register pairs of frames of RECORDING by every method and compare."""
    cv2.setNumThreads(1)
    few = quick_values(context, quick, QUICK)
    options: dict[str, Any] = {
        "keyframes": keyframes,
        "wanted": few.get("wanted", wanted),
        "peers": few.get("names", names),
        "pictures": pictures,
        "lags_ms": range(LAG_STEP_MS, lag_ms + 1, LAG_STEP_MS),
        "seed": seed,
    }
    reading = Reading(every, not unregistered)
    with read_source(recording, detector_of(model, threshold), seed, reading=reading) as source:
        result = compare(source, RegistrarParams(), options)
    if json_file is not None:
        json_file.write_text(json.dumps(result, indent=1))


if __name__ == "__main__":
    main()
