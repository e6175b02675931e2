# SPDX-License-Identifier: Apache-2.0
"""Registration of pairs of real frames, judged by the recording's true poses, beside the usual methods in the same run.

A pair could close when both frames show an object at one place (one confusable label, middles within 15 cm in the
world); it could not when they share a label but no object, and see less than 2 % of each other. The moments lie 2 s
apart or more. Errors are of the camera's pose: strict is 3 degrees and 5 cm, loose 5 degrees and 10 cm, wrong is beyond
8 degrees or 15 cm; whatever is accepted of a pair that could not close counts as wrong unless it is loose.

    python benchmarks/pairs.py REC --json pairs.json --pictures failures/
"""

from __future__ import annotations

import json
import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import click
import cv2
import numpy as np
from peers import Answer, Peer, Shot, peers
from sources import Source, read_source

from objreg_ros.data import Array, DepthImage, Frame, Reason
from objreg_ros.geometry import back_project, inverse, pose_error, rotation_angle, transform
from objreg_ros.registrar.candidate import Candidate
from objreg_ros.registrar.engine import Engine
from objreg_ros.registrar.fusion import fuse
from objreg_ros.registrar.gate import judge
from objreg_ros.registrar.keyframe import Keyframe
from objreg_ros.registrar.keyframes import Keyframer, Stretch
from objreg_ros.registrar.labels import LabelGroups
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registrar.verify import look, verify
from objreg_ros.registrar.visibility import INLIERS, Sight, prepare_sight

STRICT, LOOSE, WRONG = (3.0, 5.0), (5.0, 10.0), (8.0, 15.0)  # degrees, centimetres
BINS = ((0, 10), (10, 20), (20, 30), (30, 45), (45, 180))  # degrees of view change
APART_NS = 2_000_000_000
SAME_PLACE = 0.15  # m
NO_OVERLAP = 0.02


class Pair(NamedTuple):
    """Keyframes by index, the true ``T_target_source``, the view change in degrees, and whether they could close."""

    source: int
    target: int
    T_target_source: Array
    turned: float
    could_close: bool


@dataclass
class Row:
    """What one method said of one pair: the error of its pose, whether it stands by it, and the time it took."""

    error: tuple[float, float] | None
    accepted: bool
    ms: float
    reason: str = ""
    T: Array | None = field(default=None, repr=False)


def single(frame: Frame, params: RegistrarParams) -> Keyframe:
    """A keyframe of one frame."""
    return fuse(Stretch(frames=(frame,), T_first_frame=(np.eye(4),), T_session_first=np.eye(4), session=0), params)


def fused(frames: Sequence[Frame], params: RegistrarParams) -> list[Keyframe]:
    """The keyframes that the registrar would make of a recording."""
    keyframer = Keyframer(params)
    stretches = [keyframer.add(frame) for frame in frames] + [keyframer.finish()]
    return [fuse(stretch, params) for stretch in stretches if stretch is not None]


class Truths:
    """What is true of the keyframes of a recording."""

    def __init__(self, keyframes: Sequence[Keyframe], poses: Sequence[Array], params: RegistrarParams) -> None:
        self._keyframes, self._poses, self._params = keyframes, poses, params
        groups = LabelGroups(params.label_groups)
        self._groups = [np.array([groups.of(label) for label in k.labels]) for k in keyframes]
        self._places = [
            transform(T, np.array([o.centroid for o in k.objects]).reshape(-1, 3))
            for k, T in zip(keyframes, poses, strict=True)
        ]
        self._sights: dict[int, Sight] = {}

    def sight(self, index: int) -> Sight:
        """The view of a keyframe, made ready once."""
        if index not in self._sights:
            params = self._params
            self._sights[index] = prepare_sight(self._keyframes[index].view, params.context_range, params.detail_sigma)
        return self._sights[index]

    def pair(self, i: int, j: int) -> Pair | None:
        """The pair if it is one or the other kind, None if it is neither or the moments are too near."""
        if abs(self._keyframes[i].stamp_ns - self._keyframes[j].stamp_ns) < APART_NS:
            return None
        same = self._groups[i][:, None] == self._groups[j][None]
        if not same.any():
            return None
        gaps = np.linalg.norm(self._places[i][:, None] - self._places[j][None], axis=-1)
        T = inverse(self._poses[j]) @ self._poses[i]
        turned = float(np.degrees(rotation_angle(T[:3, :3])))
        return Pair(i, j, T, turned, bool((gaps[same] < SAME_PLACE).any()))

    def apart(self, pair: Pair) -> bool:
        """Whether the two views see next to nothing of each other."""
        a, b, T = self.sight(pair.source), self.sight(pair.target), pair.T_target_source
        shares = [
            look(x, y, M, self._params, 2000)[INLIERS] / max(1, min(2000, len(x.points)))
            for x, y, M in ((a, b, T), (b, a, inverse(T)))
        ]
        return max(shares) < NO_OVERLAP


def draw_pairs(truths: Truths, count: int, wanted: int, seed: int) -> list[Pair]:
    """``wanted`` pairs of each kind, those that could close spread over the bins, in a random order."""
    rng = np.random.default_rng(seed)
    indices = rng.permutation(count * count)
    bins: dict[int, list[Pair]] = {k: [] for k in range(len(BINS))}
    apart: list[Pair] = []
    for flat in indices:
        pair = truths.pair(*divmod(int(flat), count))
        if pair is None:
            continue
        if pair.could_close:
            bins[next(k for k, (low, high) in enumerate(BINS) if low <= pair.turned <= high)].append(pair)
        elif len(apart) < wanted and truths.apart(pair):
            apart.append(pair)
    return _spread(list(bins.values()), wanted) + apart


def _spread(bins: list[list[Pair]], wanted: int) -> list[Pair]:
    """Pairs from each bin in turn until there are enough."""
    chosen: list[Pair] = []
    while len(chosen) < wanted and any(bins):
        for pairs in bins:
            if pairs and len(chosen) < wanted:
                chosen.append(pairs.pop())
    return chosen


class Ours:
    """The engine and the gate."""

    def __init__(self, keyframes: Sequence[Keyframe], params: RegistrarParams) -> None:
        self._keyframes, self._params = keyframes, params
        self.engine = Engine(params)

    def __call__(self, pair: Pair) -> Row:
        """The accepted candidate, or the best one and the reason for refusing it."""
        start = time.perf_counter()
        candidates = self.engine.propose(self._keyframes[pair.source], self._keyframes[pair.target])
        verdict = judge(candidates, self._params)
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

    def __init__(self, peer: Peer, voxel: float = 0.03) -> None:
        self.name, self._peer, self._voxel = f"{peer.name}+gicp", peer, voxel

    def prepare(self, shot: Shot) -> Any:
        """What the peer prepares, and a cloud for GICP."""
        import small_gicp

        camera, depth = shot.image.intrinsics, shot.image.depth
        xyz = back_project(depth, camera.fx, camera.fy, camera.cx, camera.cy)[(depth > 0) & (depth < 4.0)]
        return self._peer.prepare(shot), small_gicp.preprocess_points(xyz.astype(np.float64), self._voxel, 12, 1)

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

    def __init__(self, method: Callable[[Pair], Row], truths: Truths, params: RegistrarParams) -> None:
        self._method, self._truths, self._params = method, truths, params

    def __call__(self, pair: Pair) -> Row:
        """The method's pose; accepted if the views' score is at least ``min_score``."""
        row = self._method(pair)
        if row.T is None:
            return row
        start = time.perf_counter()
        source, target = self._truths.sight(pair.source), self._truths.sight(pair.target)
        seen = verify(source, target, row.T, self._params)
        ms = row.ms + 1e3 * (time.perf_counter() - start)
        accepted = seen.score >= self._params.min_score and seen.tested >= self._params.min_tested
        return Row(row.error, accepted, ms, "" if accepted else "views", row.T)


def _row(T: Array | None, accepted: bool, ms: float, pair: Pair, reason: str = "") -> Row:
    if T is None or not np.isfinite(T).all():
        return Row(None, False, ms, reason)
    return Row(pose_error(T, pair.T_target_source), accepted, ms, reason, np.asarray(T))


def within(error: tuple[float, float] | None, limit: tuple[float, float]) -> bool:
    """Whether an error is at most so many degrees and centimetres."""
    return error is not None and error[0] <= limit[0] and error[1] <= limit[1]


def is_wrong(pair: Pair, row: Row) -> bool:
    """Whether an accepted pose is a lie."""
    return row.accepted and not within(row.error, WRONG if pair.could_close else LOOSE)


def summed(pairs: Sequence[Pair], rows: Sequence[Row]) -> dict[str, Any]:
    """The figures of one method over some pairs."""
    could = [(p, r) for p, r in zip(pairs, rows, strict=True) if p.could_close]
    share = lambda test: float(np.mean([test(r) for _, r in could])) if could else None  # noqa: E731
    found = [r.error for _, r in could if within(r.error, LOOSE)]
    return {
        "tried": len(pairs),
        "could_close": len(could),
        "strict": share(lambda r: within(r.error, STRICT)),
        "loose": share(lambda r: within(r.error, LOOSE)),
        "accepted_strict": share(lambda r: r.accepted and within(r.error, STRICT)),
        "accepted_recall": share(lambda r: r.accepted and within(r.error, LOOSE)),
        "wrong": sum(is_wrong(p, r) for p, r in zip(pairs, rows, strict=True)),
        "wrong_of_could_not": sum(is_wrong(p, r) for p, r in zip(pairs, rows, strict=True) if not p.could_close),
        "rotation_deg": float(np.median([e[0] for e in found])) if found else None,
        "translation_cm": float(np.median([e[1] for e in found])) if found else None,
        "ms_p50": float(np.percentile([r.ms for r in rows], 50)),
        "ms_p95": float(np.percentile([r.ms for r in rows], 95)),
        "refused": dict(Counter(r.reason for _, r in could if not r.accepted and r.reason)),
    }


def figures(pairs: Sequence[Pair], rows: Sequence[Row], middle: int) -> dict[str, Any]:
    """A method's figures: over all, by view change, and by half of the recording.

    Our thresholds are fixed on the first half: ``fitted`` are the pairs within it, ``held_out`` those within the
    second, ``across`` those of one frame of each.
    """
    out = summed(pairs, rows)
    out["by_view_change"] = {}
    for low, high in BINS:
        chosen = [k for k, p in enumerate(pairs) if p.could_close and low <= p.turned < high]
        if chosen:
            part = summed([pairs[k] for k in chosen], [rows[k] for k in chosen])
            out["by_view_change"][f"{low}-{high}"] = {
                key: part[key] for key in ("could_close", "loose", "accepted_recall", "wrong")
            }
    sides: dict[str, list[int]] = {"fitted": [], "held_out": [], "across": []}
    for k, pair in enumerate(pairs):
        late = (pair.source >= middle) + (pair.target >= middle)
        sides[("fitted", "across", "held_out")[late]].append(k)
    parts = {name: summed([pairs[k] for k in side], [rows[k] for k in side]) for name, side in sides.items() if side}
    shown = ("tried", "could_close", "loose", "accepted_recall", "wrong")
    out["half"] = {name: {key: part[key] for key in shown} for name, part in parts.items()}
    return out


def picture(images: tuple[DepthImage, DepthImage], T_target_source: Array, text: str) -> Array:
    """Source, target, and the source's points painted into the target's picture, side by side, as BGR."""
    source, target = images
    assert source.rgb is not None and target.rgb is not None
    a, b = source.intrinsics, target.intrinsics
    points = back_project(source.depth, a.fx, a.fy, a.cx, a.cy)[source.depth > 0]
    moved = transform(T_target_source, points)
    colours, moved = source.rgb[source.depth > 0][moved[:, 2] > 0.2], moved[moved[:, 2] > 0.2]
    u, v = (b.fx * moved[:, 0] / moved[:, 2] + b.cx).astype(int), (b.fy * moved[:, 1] / moved[:, 2] + b.cy).astype(int)
    inside = (u >= 0) & (v >= 0) & (u < b.width) & (v < b.height)
    painted = target.rgb // 3
    order = np.argsort(-moved[inside, 2])
    painted[v[inside][order], u[inside][order]] = colours[inside][order]
    sheet = np.concatenate([source.rgb, target.rgb, painted], axis=1)[..., ::-1].copy()
    cv2.putText(sheet, text, (10, 30), cv2.FONT_HERSHEY_SIMPLEX, 0.8, (0, 255, 255), 2)
    return sheet


def draw_failures(
    folder: Path, pairs: Sequence[Pair], rows: Sequence[Row], image: Callable[[int], DepthImage], most: int = 12
) -> None:
    """The worst of a method as pictures: what was accepted and wrong first, then the largest errors."""
    folder.mkdir(parents=True, exist_ok=True)
    worth = [
        (is_wrong(p, r), p.could_close and not within(r.error, LOOSE), r.error[0] + r.error[1], k)
        for k, (p, r) in enumerate(zip(pairs, rows, strict=True))
        if r.error is not None and r.T is not None
    ]
    for wrong, failed, _, k in sorted(worth, reverse=True)[:most]:
        pair, row = pairs[k], rows[k]
        if not (wrong or failed) or row.T is None or row.error is None:
            continue
        text = f"{'ACCEPTED' if row.accepted else row.reason} {row.error[0]:.1f} deg {row.error[1]:.0f} cm"
        sheet = picture((image(pair.source), image(pair.target)), row.T, f"{text}, turned {pair.turned:.0f} deg")
        cv2.imwrite(str(folder / f"{pair.source:04d}_{pair.target:04d}.jpg"), sheet)


def methods_of(
    source: Source, keyframes: Sequence[Keyframe], truths: Truths, params: RegistrarParams, names: Sequence[str]
) -> dict[str, Callable[[Pair], Row]]:
    """The methods to compare, ours first."""
    frames = {frame.stamp_ns: frame for frame in source.frames}

    def shot(index: int) -> Shot:
        return source.shot(frames[keyframes[index].stamp_ns])

    methods: dict[str, Callable[[Pair], Row]] = {"ours": Ours(keyframes, params)}
    for peer in peers(tuple(names)):
        methods[peer.name] = Theirs(peer, shot)
        if peer.name in ("sift_pnp", "fpfh_icp"):
            finished = Finished(peer)
            methods[finished.name] = Theirs(finished, shot)
            methods[f"{finished.name}+our views"] = Checked(Theirs(finished, shot), truths, params)
    return methods


def compare(source: Source, params: RegistrarParams, options: dict[str, Any]) -> dict[str, Any]:
    """All methods over the same pairs of one recording."""
    frames = [frame for frame in source.frames if source.truth.at(frame.stamp_ns) is not None]
    makes = fused(frames, params) if options["keyframes"] else [single(frame, params) for frame in frames]
    keyframes = [keyframe for keyframe in makes if keyframe.objects]
    poses = [source.truth.at(keyframe.stamp_ns) for keyframe in keyframes]
    truths = Truths(keyframes, [T for T in poses if T is not None], params)
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


def line(name: str, row: dict[str, Any]) -> str:
    """One method in one line."""
    show = lambda value: "  -  " if value is None else f"{value:.3f}"  # noqa: E731
    return (
        f"{name:28s} strict {show(row['strict'])} loose {show(row['loose'])} accepted {show(row['accepted_recall'])} "
        f"wrong {row['wrong']:3d} of {row['tried']}  {row['ms_p50']:.0f} ms (p95 {row['ms_p95']:.0f})"
    )


@click.command()
@click.argument("recording", type=click.Path(exists=True, path_type=Path))
@click.option("--json", "json_file", type=click.Path(dir_okay=False, path_type=Path), help="Write the figures here.")
@click.option("--keyframes", is_flag=True, help="Fused keyframes instead of single frames.")
@click.option("--quick", is_flag=True, help="Few pairs, ours and two peers.")
@click.option("--wanted", default=200, show_default=True, help="Pairs of each kind.")
@click.option("--model", default="", help="ONNX model; empty: the default one.")
@click.option("--peers", "names", default="paper,orb_pnp,sift_pnp,fpfh_icp", show_default=True)
@click.option("--pictures", type=click.Path(file_okay=False, path_type=Path), help="Draw the worst failures here.")
@click.option("--seed", default=1, show_default=True)
def main(
    recording: Path,
    json_file: Path | None,
    keyframes: bool,
    quick: bool,
    wanted: int,
    model: str,
    names: str,
    pictures: Path | None,
    seed: int,
) -> None:
    """Register pairs of frames of RECORDING by every method and compare."""
    cv2.setNumThreads(1)
    options: dict[str, Any] = {
        "keyframes": keyframes,
        "wanted": 15 if quick else wanted,
        "peers": [name for name in ("paper,orb_pnp" if quick else names).split(",") if name],
        "pictures": pictures,
        "seed": seed,
    }
    with read_source(recording, model, seed) as source:
        result = compare(source, RegistrarParams(), options)
    if json_file is not None:
        json_file.write_text(json.dumps(result, indent=1))


if __name__ == "__main__":
    main()
