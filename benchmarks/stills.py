# SPDX-License-Identifier: Apache-2.0
"""A recording as if its camera took stills: of its moments every so many-th, with nothing between them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from objreg_tools.recording import Recording
from objreg_tools.recording.inputs import Inputs
from objreg_tools.recording.record import Record

CAMERA = ("image", "points", "depth", "camera_info", "colour_info")  # inputs that a moment is made of


def stills(recording: Recording, inputs: Inputs, every: int) -> Iterator[Record]:
    """The records of the chosen topics; those of the camera only at every so many-th picture, the first among them.

    What belongs to a picture is what was recorded nearest to it. ValueError for a recording without pictures.
    """
    chosen = inputs.chosen()
    records = recording.records(set(chosen.values()))
    if every == 1:
        return records
    if inputs.image is None:
        raise ValueError("expected a recording with pictures to take stills of, got none")
    pictures = np.array([record.stamp_ns for record in recording.records({inputs.image})], np.int64)
    return thinned(records, {chosen[name] for name in CAMERA if name in chosen}, pictures, every)


def thinned(records: Iterable[Record], topics: set[str], pictures: np.ndarray, every: int) -> Iterator[Record]:
    """The records, of those of ``topics`` only the nearest to every so many-th of the moments ``pictures (N,)`` ns."""
    between = (pictures[:-1] + pictures[1:]) // 2  # where the next picture is nearer
    for record in records:
        if record.topic not in topics or np.searchsorted(between, record.stamp_ns) % every == 0:
            yield record
