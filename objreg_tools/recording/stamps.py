# SPDX-License-Identifier: Apache-2.0
"""Whether the stamps in the headers of colour and depth let the two be brought together."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice

import numpy as np

from objreg_ros.bridge.messages import headers
from objreg_ros.data.checked import Array
from objreg_ros.plausibility.finding import Finding
from objreg_tools.recording.inputs import Inputs
from objreg_tools.recording.mounts import first_readable
from objreg_tools.recording.record import Recording

SAMPLE = 60  # messages of colour and depth whose stamps are compared
NEAR_NS = 20_000_000  # how far apart colour and depth may be for the nodes' default slop
FAR_NS = 200_000_000  # a camera moves on within this time: matching such frames makes wrong objects
STEADY_NS = 6_000_000  # streams whose distance varies by less are a steady time apart
FEW = 5  # stamps: of fewer nothing is steady


def stamps(recording: Recording, inputs: Inputs) -> list[Finding]:
    """Whether the stamps in the headers let colour and depth be brought together."""
    topics = inputs.image, inputs.depth or inputs.points
    begins = [
        record.stamp_ns for topic in topics if topic and (record := next(recording.records([topic]), None)) is not None
    ]
    colour, depth = (_header_stamps(recording, topic, max(begins, default=0)) for topic in topics)
    found = [*_clock_findings("colour", colour), *_clock_findings("depth", depth)]
    readable = all(first_readable(recording, topic) is not None for topic in topics)
    if readable and not (len(colour) and len(depth)):
        what = "colour and depth were recorded at different times: none goes with the other"
        found.append(Finding(what, "", "record both together", "streams-apart"))
    if len(colour) and len(depth):
        found += _distance(*_apart_ns(colour, depth))
    return found


def _clock_findings(name: str, stamps: Array) -> Iterator[Finding]:
    """Whether the stamps of a stream advance."""
    if (np.diff(stamps) < 0).any():
        yield Finding(f"the stamps of {name} go back in time: what waits is dropped there")
    if len(stamps) > 1 and (stamps == stamps[0]).all():
        yield Finding(
            f"the first {len(stamps)} stamps of {name} are all {stamps[0]} ns",
            "a stamp is what identifies a frame: none of these closes a loop",
            "record it again with the time in its headers",
            "streams-apart",
        )


def _distance(apart_ns: float, is_steady: bool) -> Iterator[Finding]:
    """Whether colour and depth are too far apart in time for the nodes' defaults."""
    if apart_ns <= NEAR_NS:
        return
    what = f"colour and depth are {apart_ns * 1e-6:.0f} ms apart"
    if apart_ns > FAR_NS:
        cause, todo = "their stamps are of two clocks", "record both with stamps of one clock"
    elif is_steady:
        what = f"{what} all the time"
        cause = "one of the two is stamped late, or the camera takes them so far apart"
        todo = "mend the stamp in the driver (its time offset), or let the camera take both at once"
    else:
        cause = "the two streams of the camera are not synchronised, and frames meet within segmenter.slop"
        todo = f"raise segmenter.slop above that: --set segmenter.slop={np.ceil(apart_ns * 1e-7 + 1) / 100:.2f}"
    yield Finding(what, cause, todo, "streams-apart")


def _apart_ns(colour: Array, depth: Array) -> tuple[float, bool]:
    """How far the stamps of the slower stream are from the nearest of the faster one, the median; and whether that is
    steady.

    Only those within the time of both count, unless there are none.
    """
    slow, fast = sorted((colour, depth), key=_rate)
    within = slow[(slow >= fast.min()) & (slow <= fast.max())]
    slow = within if len(within) else slow
    after = slow[:, None] - fast[None, :]
    nearest = np.take_along_axis(after, np.abs(after).argmin(axis=1)[:, None], axis=1)
    is_steady = len(slow) >= FEW and float(np.ptp(np.quantile(nearest, [0.1, 0.9]))) < STEADY_NS
    return float(np.median(np.abs(nearest))), is_steady


def _rate(stamps: Array) -> float:
    """Stamps in a second; 0 for fewer than two."""
    step_ns = float(np.median(np.abs(np.diff(stamps)))) if len(stamps) > 1 else 0.0
    return 1e9 / step_ns if step_ns else 0.0


def _header_stamps(recording: Recording, topic: str | None, start_ns: int) -> Array:
    """The first `SAMPLE` stamps of what was recorded from a time on and decodes."""
    messages = (record.read() for record in recording.records([topic], start_ns)) if topic else iter(())
    readable = islice((message for message in messages if message is not None), SAMPLE)
    return np.array([headers.stamp_ns(message) for message in readable], np.int64)
