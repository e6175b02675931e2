# SPDX-License-Identifier: Apache-2.0
"""Where a run stopped short of a closed loop, why it is likely so, and what to do next.

Everything is read from the JSON of a run, that of `objreg offline` or of `objreg demo`. The findings on its recording
come beside it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

from objreg_ros import share
from objreg_ros.data.closures import UNTRIED, Reason
from objreg_ros.plausibility.finding import Finding
from objreg_tools.offline.run import Run
from objreg_tools.recording.inputs import Inputs
from objreg_tools.recording.record import Recording
from objreg_tools.report.closures.closed_revisits import ClosedRevisits
from objreg_tools.report.run.reasons import REFUSALS
from objreg_tools.report.words import change, judgement, number_of

MANY = 0.05  # of the frames of a node; fewer that are overtaken are usual
SELDOM = 0.2  # of the frames; a model that knows what it sees finds more
LATE_MS, LATE_SIGMAS = 45.0, 4.0  # cameras whose two pictures are taken in turn are up to a picture apart
OVERTAKEN, ALL_REFUSED = "overtaken", "all-refused"
SOURCES = {"odometry": "odometry", "tracked": "our own tracking"}  # of a trajectory, in words
PASSED_OVER = tuple(reason.value for reason in (Reason.OVER_BUDGET, Reason.CLOCK, Reason.UNREADABLE))
LOOK = "objreg inspect {recording}"
FETCH = "get a model of real objects with `objreg fetch-model`, then run again"
SIMULATED_TOPICS = ("/image", "/image/compressed")
SIMULATED_TRUTH = "truth/frames.jsonl"  # what `objreg simulate` writes beside


def setting(recording: Recording, inputs: Inputs, model: str) -> dict[str, Any]:
    """What `find` takes from a run's JSON: the file of the model, and whether the recording is simulated.

    That is None where it could be either: a recording with the topics of the simulator, but without its truth.
    For a folder of pictures the result has ``pictures`` too, since there is no other topic to take.
    """
    made = {"model": share.model(model).name, "simulated": _is_simulated(recording, inputs)}
    return {**made, "pictures": True} if recording.of_pictures else made


def _is_simulated(recording: Recording, inputs: Inputs) -> bool | None:
    folder = recording.path if recording.path.is_dir() else recording.path.parent
    if (folder / SIMULATED_TRUTH).is_file():
        return True
    return None if recording.kind.startswith("rosbag2") and inputs.image in SIMULATED_TOPICS else False


@dataclass(frozen=True, slots=True)
class Counts:
    """How far the frames of a run came, one number a step."""

    frames: int
    detections: int
    objects: int
    constraints: int
    tried: Mapping[str, int]  # refused candidates by reason, those that were not tried left out
    dropped: Mapping[str, int]  # frames by reason, of all nodes

    @classmethod
    def of(cls, summary: Mapping[str, Any]) -> Counts:
        """The counts of a run's JSON; what the live graph's JSON lacks is counted from its frames."""
        nodes, glimpses = summary.get("nodes", {}), summary.get("glimpses", ())
        dropped = Counter(summary.get("dropped", {}))
        for counters in nodes.values():
            dropped.update(counters.get("dropped", {}))
        through = nodes["segmenter"]["published"] if "segmenter" in nodes else len(glimpses)
        untried = {reason.value for reason in UNTRIED}
        return cls(
            summary.get("frames", through),
            summary.get("detections", sum(len(row.get("labels", ())) for row in glimpses)),
            summary.get("objects", sum(len(row.get("objects", ())) for row in glimpses)),
            len(summary.get("constraints", ())),
            {reason: count for reason, count in summary.get("rejected", {}).items() if reason not in untried},
            dropped,
        )


def find(summary: Mapping[str, Any], of_recording: Iterable[Finding] = ()) -> tuple[Finding, ...]:
    """Where the run stopped first, if no loop was closed; then all other findings on it and its recording.

    A stream that was measured to differ from what it states comes first among the causes.
    """
    counts, causes = Counts.of(summary), tuple(Finding(**row) for row in summary.get("stream", ()))
    of_recording = tuple(of_recording)
    steps = (_no_frame, _no_detections, _no_objects)
    later = () if causes else (_none_tried, _no_revisit, _all_refused)
    stopped = None if counts.constraints else _first((*steps, *later), counts, summary)
    if stopped is not None and stopped.anchor == ALL_REFUSED and of_recording:
        stopped = replace(stopped, cause=f"what is wrong with the recording, below; else {stopped.cause}")
    found = (
        stopped,
        *causes,
        _late_depth(summary),
        *of_recording,
        _simulated_model(counts, summary),
        _overtaken(summary),
        _over_budget(summary),
    )
    return tuple(dict.fromkeys(finding for finding in found if finding is not None))


def _late_depth(summary: Mapping[str, Any]) -> Finding | None:
    """Depth that matches colour by its stamp, but was captured at another time."""
    lag = summary.get("depth_lag")
    if lag is None or abs(lag["ms"]) < max(LATE_MS, LATE_SIGMAS * lag["sigma_ms"]):
        return None
    by, side = f"{abs(lag['ms']):.0f} ± {lag['sigma_ms']:.0f} ms", "before" if lag["ms"] > 0 else "after"
    return Finding(
        f"depth was captured {by} {side} the picture of its stamp",
        "the stamps of colour and depth are of different times; as the camera turns, depth lies beside its picture",
        "correct the stamps in the driver (its time offset), or let the camera take both at once",
        "streams-apart",
    )


def found_in(run: Run) -> tuple[Finding, ...]:
    """What a run measured of its stream; why it has no frame, where it has none."""
    summary = {"frames": run.frames, "dropped": run.dropped, "complaints": run.complaints}
    stopped = _no_frame(Counts.of(summary), summary)
    return run.findings if stopped is None else (stopped,)


def as_json(findings: Iterable[Finding]) -> list[dict[str, str]]:
    """The findings as the field ``findings`` of a run's JSON."""
    return [asdict(finding) for finding in findings]


Step = Callable[[Counts, Mapping[str, Any]], Finding | None]


def _first(steps: Iterable[Step], counts: Counts, summary: Mapping[str, Any]) -> Finding | None:
    return next((finding for step in steps if (finding := step(counts, summary)) is not None), None)


def _no_frame(counts: Counts, summary: Mapping[str, Any]) -> Finding | None:
    if counts.frames:
        return None
    what = f"no frame got through: {counted(counts.dropped)}" if counts.dropped else "no frame came in"
    anchor = "no-frame-got-through"
    malformed = {reason: n for reason, n in counts.dropped.items() if reason.startswith("malformed_")}
    if malformed:
        said = summary.get("complaints", {}).get(max(malformed, key=lambda reason: malformed[reason]), "")
        cause = "the messages do not match what their topics state" + (f" ({said})" if said else "")
        other = "repair or replace these files" if summary.get("pictures") else "take others with --remap"
        return Finding(what, cause, f"see which with `{_look(summary)}`, and {other}", anchor)
    if counts.dropped:
        cause = "colour, depth and camera_info did not meet in time"
        return Finding(what, cause, f"compare their stamps with `{_look(summary)}`; segmenter.slop widens it", anchor)
    cause = "the recording has no pair of colour and depth, or --max-frames, --start or --end leave it out"
    return Finding(what, cause, f"see what is in it with `{_look(summary)}`", anchor)


def _no_detections(counts: Counts, summary: Mapping[str, Any]) -> Finding | None:
    if counts.detections:
        return None
    return Finding(
        f"nothing was detected in {counts.frames} frames" + _unnamed(counts),
        "the model does not know what is in view, or nothing reaches detector.threshold",
        f"lower it with --set detector.threshold=0.3; {_other_model(summary)}",
        "no-detections",
    )


def _unnamed(counts: Counts) -> str:
    return f", and {counts.objects} objects without a name are not enough for a loop" if counts.objects else ""


def _other_model(summary: Mapping[str, Any]) -> str:
    return FETCH if summary.get("model") == share.EMBEDDED else "or name another model with --model"


def _no_objects(counts: Counts, summary: Mapping[str, Any]) -> Finding | None:
    if counts.objects:
        return None
    return Finding(
        f"{counts.detections} detections in {counts.frames} frames, and no object in their depth",
        "depth has holes there, is not registered to colour, or is in other units than its encoding says",
        f"look at the size, frame and range of depth with `{_look(summary)}`",
        "no-objects",
    )


def _none_tried(counts: Counts, summary: Mapping[str, Any]) -> Finding | None:
    """Where places looked like ones that were seen before, and all of them were passed over."""
    rejected = summary.get("rejected", {})
    passed_over = {reason: rejected[reason] for reason in PASSED_OVER if rejected.get(reason)}
    if counts.tried or not passed_over:
        return None
    most = max(passed_over, key=lambda reason: passed_over[reason])
    if most == Reason.OVER_BUDGET.value:
        return _over_budget(summary)
    entry = REFUSALS[most]
    what = f"{passed_over[most]} candidates were not tried: {entry.meaning}"
    return Finding(what, todo=entry.remedy.removesuffix("."), anchor=most)


def _no_revisit(counts: Counts, summary: Mapping[str, Any]) -> Finding | None:
    if counts.tried:
        return None
    return Finding(
        f"{counts.objects} objects in {counts.frames} frames, and no place looked like one that was seen before",
        "the camera did not come back, or the recording ends before it did",
        "record until the camera sees the same objects again, from near where it saw them first",
        "no-revisit",
    )


def _all_refused(counts: Counts, summary: Mapping[str, Any]) -> Finding | None:
    return Finding(
        f"all {sum(counts.tried.values())} candidates were refused: {counted(counts.tried)}",
        "what came back was seen from too different a side, or too little of it, to be sure",
        "look at the refused pairs in the report (`objreg report RUN.json`), and come back nearer to the first view",
        ALL_REFUSED,
    )


def _simulated_model(counts: Counts, summary: Mapping[str, Any]) -> Finding | None:
    simulated, few = summary.get("simulated"), counts.detections < SELDOM * counts.frames
    doubtful = few or (simulated is False and not counts.constraints)
    if summary.get("model") != share.EMBEDDED or simulated or not (doubtful and counts.frames):
        return None
    return Finding(
        f"the detector's model, {share.EMBEDDED}, was trained on simulated rooms",
        f"of real ones it knows little: {counts.detections} detections in {counts.frames} frames",
        FETCH,
        "model-of-simulated-rooms",
    )


def simulated_model_on_real(setting: Mapping[str, Any]) -> Finding | None:
    """A recording that was not simulated, with the model that knows simulated rooms; ``setting`` as `setting` gives."""
    if setting.get("model") != share.EMBEDDED or setting.get("simulated") is not False:
        return None
    return Finding(
        f"the detector's model, {share.EMBEDDED}, was trained in simulation, and this recording is real",
        "of real objects it knows little, and finds fewer places again than it could",
        FETCH,
        "model-of-simulated-rooms",
    )


def _overtaken(summary: Mapping[str, Any]) -> Finding | None:
    late = {
        node: f"{counters['dropped'][OVERTAKEN]} of {counters['received']}"
        for node, counters in summary.get("nodes", {}).items()
        if counters.get("dropped", {}).get(OVERTAKEN, 0) > MANY * counters.get("received", 0)
    }
    if not late:
        return None
    return Finding(
        "frames were overtaken by newer ones: " + ", ".join(f"{node} {count}" for node, count in late.items()),
        "this machine is slower than the camera; that costs frames, and no closure is wrong for it",
        "play slower (--rate 0.5) or wait for every frame (--lossless); on a robot raise detector.threads and "
        "registrar.threads, or bound the search with registrar.search_seconds",
        "overtaken",
    )


def _over_budget(summary: Mapping[str, Any]) -> Finding | None:
    count = summary.get("rejected", {}).get("over_budget", 0)
    if not count:
        return None
    return Finding(
        f"{count} candidates were not tried: time ran out before",
        "newer keyframes waited, or registrar.search_seconds ended the search",
        "play slower (--rate 0.5 or --lossless), raise registrar.threads or registrar.search_seconds (0: no limit)",
        "over-budget",
    )


def _look(summary: Mapping[str, Any]) -> str:
    return LOOK.format(recording=summary.get("recording", "RECORDING"))


def counted(counts: Mapping[str, int]) -> str:
    """``3 low_overlap, 1 gravity_not_kept``, the most frequent first."""
    return ", ".join(f"{count} {reason}" for reason, count in sorted(counts.items(), key=lambda row: -row[1]))


def verdict(
    summary: Mapping[str, Any],
    findings: Sequence[Finding] = (),
    closed: ClosedRevisits | None = None,
    trajectory: Mapping[str, Any] | None = None,
) -> str:
    """Whether the run worked and how well, in one line; ``trajectory`` as `RunSummary.trajectory` makes it."""
    counts, truth = Counts.of(summary), summary.get("truth", {})
    if not counts.frames:
        return "It did not work: no frame got through."
    if not counts.constraints:
        return f"No loop was closed: {findings[0].what}." if findings else "No loop was closed."
    found = number_of(counts.constraints, "constraint") if closed is None else closed.text
    judged = truth.get("count", 0)
    parts = [
        f"{found}, in {number_of(counts.frames, 'frame')}",
        judgement(truth.get("false", 0), judged, counts.constraints) + (_off(truth) if judged else ""),
        *_corrected(trajectory),
    ]
    return f"{_opening(closed, truth, trajectory)}: {'; '.join(parts)}."


def _opening(closed: ClosedRevisits | None, truth: Mapping[str, Any], trajectory: Mapping[str, Any] | None) -> str:
    """It worked where a revisit was closed, nothing is false and the trajectory is no worse for it."""
    if truth.get("false"):
        return "Not quite"
    if closed is not None and not closed.revisits:
        return "It is not known whether a loop was closed" if closed.unknown else "No loop was closed"
    error = (trajectory or {}).get("error_cm")
    return "Not quite" if error is not None and error["after"] > error["before"] else "It worked"


def _off(truth: Mapping[str, Any]) -> str:
    degrees, centimetres = truth["rotation_deg"]["median"], truth["translation_cm"]["median"]
    return f", {degrees:.2f}° and {centimetres:.1f} cm off (median)"


def _corrected(trajectory: Mapping[str, Any] | None) -> list[str]:
    """Whether constraints made the trajectory better, where truth shows it."""
    error = (trajectory or {}).get("error_cm")
    if trajectory is None or error is None:
        return []
    return [f"the corrected trajectory is {change(error['before'], error['after'], SOURCES[trajectory['of']])}"]
