# SPDX-License-Identifier: Apache-2.0
"""Where the registrar's processor time goes: what a frame, a keyframe, a pair and each step of the engine costs.

One thread, the processor's own seconds, so that a busy machine tells the same. A step's time is without that of the
steps it calls. ``searched`` is what a keyframe costs from its frames to its verdicts; of the pairs it is told what an
accepted and what a refused one costs, and how many candidates, competitors among them, were finished for it.

    python benchmarks/search_cost.py REC --model MODEL
"""

from __future__ import annotations

import json
import sys
import time
from collections import defaultdict
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import click
import numpy as np
from sources import detector_of, read_source

from objreg_ros import registration
from objreg_ros.data import Array, Frame
from objreg_ros.memory.retrieval import Index
from objreg_ros.registrar import registrar as facade
from objreg_ros.registrar.registrar import Registrar
from objreg_ros.registrar.warm import warm
from objreg_ros.registration import engine
from objreg_ros.registration.candidate import Candidate
from objreg_ros.registration.certainty import observability
from objreg_ros.registration.gate.refusal import Refusal
from objreg_ros.registration.params import RegistrarParams
from objreg_ros.registration.prepare import prepared
from objreg_ros.registration.propose import competing_hypotheses, evidence, hypotheses, object_poses, refinement
from objreg_ros.registration.propose import shortlist as shortlisting
from objreg_ros.registration.propose.prior import Prior
from objreg_ros.registration.refine import batch_icp, photometric_icp

STEPS: dict[str, tuple[Any, str]] = {
    "fuse": (facade, "fuse"),
    "retrieve": (Index, "query"),
    "prepare": (prepared, "prepare"),
    "pair: the rest": (registration, "align"),
    "propose: features": (hypotheses, "from_features"),
    "propose: centroids": (hypotheses, "from_centroids"),
    "propose: objects": (hypotheses, "from_objects"),
    "propose: shapes": (object_poses, "from_shapes"),
    "propose: fine search": (object_poses.FineSearch, "improved"),
    "shortlist: draw": (shortlisting, "_drawn_best"),
    "shortlist: settle": (batch_icp, "settle"),
    "shortlist: score": (shortlisting, "_scored"),
    "shortlist: about": (shortlisting, "_about"),
    "shortlist: anchor": (shortlisting, "_anchored"),
    "shortlist: the rest": (engine, "shortlist"),
    "refine": (refinement, "refine"),
    "refine: grey": (photometric_icp, "finish"),
    "refine: local score": (observability, "score_locally"),
    "refine: better pose": (observability, "better_pose"),
    "refine: split directions": (observability, "split_directions"),
    "evidence": (evidence, "gather"),
    "competitors": (competing_hypotheses, "competing_poses"),
    "competitors: half turned": (object_poses, "half_turned"),
    "perturbation margin": (evidence, "perturbation_margin_of"),
    "surroundings": (evidence, "surroundings_of"),
    "regularised": (observability, "regularising_information"),
    "gravity": (engine.Engine, "_gravity_updated"),
}


class Profile:
    """Seconds of each step, without those of the steps that it calls, and how often it ran."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = defaultdict(float)
        self.calls: dict[str, int] = defaultdict(int)
        self._inner = [0.0]

    def timed(self, step: str, work: Callable[..., Any]) -> Callable[..., Any]:
        """``work``, its time booked on ``step``."""

        def booked(*args: Any, **named: Any) -> Any:
            start = time.process_time()
            self._inner.append(0.0)
            try:
                return work(*args, **named)
            finally:
                whole, inner = time.process_time() - start, self._inner.pop()
                self.seconds[step] += whole - inner
                self.calls[step] += 1
                self._inner[-1] += whole

        return booked

    def watch(self) -> None:
        """Book every step from now on, wherever the package calls it."""
        for step, (owner, name) in STEPS.items():
            if not hasattr(owner, name):
                continue
            plain = getattr(owner, name)
            timed = self.timed(step, plain)
            setattr(owner, name, timed)
            for module in [m for key, m in sys.modules.items() if key.startswith("objreg_ros")]:
                for at in [key for key, value in vars(module).items() if value is plain]:
                    setattr(module, at, timed)


class Watched:
    """The engine as a registrar calls it; what each pair cost and what came of it."""

    def __init__(self, params: RegistrarParams, profile: Profile) -> None:
        self._method, self._profile = engine.Engine(params, propose=engine.shortlist, score=engine.gather), profile
        self.pairs: list[tuple[float, int, int]] = []  # seconds, candidates, finished alignments

    def prepare(self, keyframe: Any) -> None:
        """As the engine."""
        self._method.prepare(keyframe)

    def propose(self, source: Any, target: Any, prior: Array | None = None) -> Any:
        """As the engine, its cost noted."""
        for keyframe in (source, target):
            self._method.prepare(keyframe)
        start, finished = time.process_time(), self._profile.calls["refine"]
        candidates = self._method.propose(source, target, prior)
        cost = time.process_time() - start
        self.pairs.append((cost, len(candidates), self._profile.calls["refine"] - finished))
        return candidates


def run(frames: Sequence[Frame], params: RegistrarParams, profile: Profile) -> dict[str, Any]:
    """One registrar over the frames."""
    method, tracked, searched, accepted = Watched(params, profile), [], [], []
    gate = registration.gate_of(params)

    def judged(candidates: Sequence[Candidate], prior: Prior | None = None) -> Candidate | Refusal:
        verdict = gate(candidates, prior)
        accepted.append(isinstance(verdict, Candidate))
        return verdict

    registrar = Registrar(params, method, judged)
    for frame in [*frames, None]:
        start = time.process_time()
        window = registrar.end() if frame is None else registrar.track(frame)
        tracked.append(time.process_time() - start)
        if window is not None:
            start = time.process_time()
            registrar.search(window)
            searched.append(time.process_time() - start)
    registrar.close()
    costs, yes = np.array(method.pairs).reshape(-1, 3), np.array(accepted, bool)
    steps = {step: {"calls": profile.calls[step], "s": round(profile.seconds[step], 2)} for step in profile.calls}
    return {
        "frames": len(frames),
        "keyframes": len(searched),
        "ms_a_frame": round(1e3 * (sum(tracked) + sum(searched)) / len(frames), 2),
        "tracked_ms": figures(tracked),
        "searched_ms": figures(searched),
        "accepted_pair_ms": figures(costs[yes, 0]),
        "refused_pair_ms": figures(costs[~yes, 0]),
        "pairs": len(yes),
        "accepted": int(yes.sum()),
        "candidates_a_pair": round(float(costs[:, 1].mean()), 2) if len(yes) else 0.0,
        "refinements_a_pair": round(float(costs[:, 2].mean()), 2) if len(yes) else 0.0,
        "steps": dict(sorted(steps.items(), key=lambda item: -item[1]["s"])),
    }


def figures(seconds: Any) -> dict[str, float]:
    """Mean, median and 95th percentile in ms."""
    ms = 1e3 * np.asarray(seconds)
    if len(ms) == 0:
        return {}
    numbers = {"mean": ms.mean(), "p50": np.percentile(ms, 50), "p95": np.percentile(ms, 95)}
    return {name: round(float(number), 1) for name, number in numbers.items()}


def table(name: str, row: dict[str, Any]) -> str:
    """One recording as text."""
    lines = [name, *(f"  {key}: {value}" for key, value in row.items() if key != "steps")]
    whole = sum(step["s"] for step in row["steps"].values())
    for step, cost in row["steps"].items():
        each = 1e3 * cost["s"] / max(1, cost["calls"])
        a_keyframe = 1e3 * cost["s"] / max(1, row["keyframes"])
        lines.append(
            f"    {step:26} {cost['calls']:6} x {each:7.2f} ms {a_keyframe:7.2f} ms a keyframe {cost['s'] / whole:6.1%}"
        )
    return "\n".join(lines)


@click.command()
@click.argument("recordings", nargs=-1, required=True, type=click.Path(exists=True, path_type=Path))
@click.option("--model", default="", help="ONNX model; `truth` takes the true boxes of a simulated recording.")
@click.option("--json", "json_file", type=click.Path(dir_okay=False, path_type=Path), help="Write the figures here.")
@click.option("--seed", default=1, show_default=True, help="Seed of the synthetic drift.")
def main(recordings: tuple[Path, ...], model: str, json_file: Path | None, seed: int) -> None:
    """Profile the registrar on RECORDINGS."""
    params = RegistrarParams(threads=1, seed=seed)
    warm(params)
    profile, rows = Profile(), {}
    profile.watch()
    for path in recordings:
        with read_source(path, detector_of(model), seed) as source:
            profile.seconds.clear()
            profile.calls.clear()
            rows[path.name] = run(source.frames, params.replaced(**source.camera), profile)
        click.echo(table(path.name, rows[path.name]))
    if json_file is not None:
        json_file.write_text(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
