# SPDX-License-Identifier: Apache-2.0
"""What differs between two results of one recording: to the last digit, or beyond what another processor may change."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np

from objreg_ros.geometry import pose_error

MOST_DEGREES = 0.01
MOST_METRES = 1e-4
MOST_OF_COVARIANCE = 0.01
"""Of a covariance: how far an entry may be off, in standard deviations of its row times that of its column."""

REAL_SIGMAS, REAL_COVARIANCE = 1.0, 0.5
"""Of a constraint between real pictures, some of which hold a pose by little: on another processor it may end anywhere
within its own standard deviation. Emulated, three of twelve do, by 0.7 of it at most. Of one the
covariance is off by 0.35 on a processor without AVX-512."""

MOST_CHANGED, MOST_FLIPPED = 0.05, 1
"""The share of pairs, and how many between accepted and refused, whose verdict may be another: a pose that little holds
ends elsewhere on another processor, and is then refused for another reason. Of six recordings three have such pairs on
one with other vector units, one to three of some 75, while all other poses agree to a millionth of a degree."""

Results = dict[str, Any]
Row = dict[str, Any]


def differences(stored: Results, now: Results, exact: bool = False, real: bool = False) -> list[str]:
    """One line for every difference of two `runs.results`; none where they agree.

    Not ``exact``: the same frames, accepts and refusals of the same moments for the same reasons but for
    `MOST_CHANGED`, constraints by the same objects, their poses within `MOST_DEGREES` and `MOST_METRES`, their
    covariances within `MOST_OF_COVARIANCE`.
    The pose of a refusal need not be the same: one that nothing holds comes out a degree off on another processor.
    Of a ``real`` recording poses may be off by `REAL_SIGMAS`, and covariances by `REAL_COVARIANCE`.
    """
    found = [
        f"{name}: {stored[name]} became {now[name]}" for name in ("frames", "dropped") if stored[name] != now[name]
    ]
    before, after = verdicts(stored), verdicts(now)
    changed = [pair for pair in sorted(before.keys() | after.keys()) if before.get(pair) != after.get(pair)]
    flipped = [pair for pair in changed if ("accepted" in before.get(pair, ())) != ("accepted" in after.get(pair, ()))]
    if exact or len(changed) > MOST_CHANGED * len(before) or len(flipped) > MOST_FLIPPED:
        found += [f"{_moments(pair)}: {_said(before.get(pair))} became {_said(after.get(pair))}" for pair in changed]
    found += _numbers(stored, now, exactly if exact else partial(beyond_tolerance, real=real))
    if exact and not found and _text(stored) != _text(now):
        found.append("the order of constraints or refusals is another")
    return found


def verdicts(results: Results) -> dict[tuple[int, int], list[str]]:
    """What was said of every pair of moments, from and to in ns: ``accepted``, or the reasons of its refusals."""
    said: dict[tuple[int, int], list[str]] = {}
    for row in results["constraints"]:
        said.setdefault(_pair(row), []).append("accepted")
    for row in results["refusals"]:
        said.setdefault(_pair(row), []).append(row["reason"])
    return {pair: sorted(of_pair) for pair, of_pair in said.items()}


def _numbers(stored: Results, now: Results, of: Callable[[Row, Row], Iterator[str]]) -> Iterator[str]:
    """What differs in constraints, and where it is exact in refusals, that are in both."""
    for kind in ("constraints", "refusals") if of is exactly else ("constraints",):
        known = {_key(row): row for row in stored[kind]}
        for row in now[kind]:
            if _key(row) in known:
                yield from (f"{_moments(_pair(row))}: {line}" for line in of(known[_key(row)], row))


def exactly(stored: Row, now: Row) -> Iterator[str]:
    """The fields of a constraint or a refusal that are not the same to the last digit."""
    for name in sorted(stored.keys() | now.keys()):
        before, after = stored.get(name), now.get(name)
        if _text(before) != _text(after):
            yield f"{name}: {_difference(name, before, after)}"


def beyond_tolerance(stored: Row, now: Row, real: bool = False) -> Iterator[str]:
    """What of a constraint is farther off than another processor may bring it."""
    if stored["labels"] != now["labels"]:
        yield f"labels: {stored['labels']} became {now['labels']}"
    degrees, metres = _apart(stored["T_from_to"], now["T_from_to"])
    most_degrees, most_metres = _deviations(stored) if real else (MOST_DEGREES, MOST_METRES)
    if not (degrees <= most_degrees and metres <= most_metres):
        yield f"T_from_to: off by {degrees:.4f}° and {1e3 * metres:.3f} mm"
    share = _off(stored["covariance"], now["covariance"])
    if not share <= (REAL_COVARIANCE if real else MOST_OF_COVARIANCE):
        yield f"covariance: off by {100 * share:.2f} %"


def _deviations(row: Row) -> tuple[float, float]:
    """What a real constraint may be off by, in degrees and in metres."""
    variances = np.diag(np.array(row["covariance"]))
    metres, radians = (REAL_SIGMAS * np.sqrt(part.sum()) for part in (variances[:3], variances[3:]))
    return float(np.degrees(radians)), float(metres)


def _difference(name: str, before: Any, after: Any) -> str:
    if name == "T_from_to" and before and after:
        return "off by {:.2g}° and {:.2g} m".format(*_apart(before, after))
    if name == "covariance":
        return f"off by {100 * _off(before, after):.2g} %"
    if name == "evidence":
        keys = [key for key in sorted(before.keys() | after.keys()) if _text(before.get(key)) != _text(after.get(key))]
        return ", ".join(f"{key} {before.get(key)} became {after.get(key)}" for key in keys) or "in another order"
    return f"{before} became {after}"


def _apart(stored: list[list[float]], now: list[list[float]]) -> tuple[float, float]:
    """How far two poses are from each other: in degrees and in metres."""
    degrees, centimetres = pose_error(np.array(now), np.array(stored))
    return degrees, centimetres / 100.0


def _off(stored: list[list[float]], now: list[list[float]]) -> float:
    """The farthest that an entry of a covariance is off, in deviations of its row times that of its column."""
    before, after = np.array(stored), np.array(now)
    deviations = np.sqrt(np.diag(before))
    return float(np.abs((after - before) / np.outer(deviations, deviations)).max())


def _pair(row: Row) -> tuple[int, int]:
    return row["from_ns"], row["to_ns"]


def _key(row: Row) -> tuple[int, int, str]:
    return (*_pair(row), row.get("reason", "accepted"))


def _moments(pair: tuple[int, int]) -> str:
    return f"{pair[0]} to {pair[1]} ns"


def _said(of_pair: list[str] | None) -> str:
    return " and ".join(of_pair) if of_pair else "untried"


def _text(value: Any) -> str:
    return json.dumps(value)  # in which a NaN is like another
