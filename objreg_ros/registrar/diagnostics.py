# SPDX-License-Identifier: Apache-2.0
"""What the registrar reports beside what nodes have in common."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from objreg_ros.diagnostics import Diagnostics, family, reading


@dataclass(frozen=True, kw_only=True)
class RegistrarDiagnostics(Diagnostics):
    """What is stored and what waits, what came from other robots, and what became of the pairs."""

    keyframes: int = reading("stored keyframes", "Keyframes in the store.", "keyframes")
    objects: int = reading("stored objects", "Objects of these keyframes.", "objects")
    landmarks: int = reading("stored landmarks", "Landmarks that these objects are sightings of.", "landmarks")
    sessions: int = reading("stored sessions", "Sessions that these keyframes are of.", "sessions")
    closures: int = reading("stored closures", "Constraints in the store.", "constraints")
    vetoed: int = reading("vetoed closures", "Constraints that a person withdrew.", "constraints")
    unsearched: int = reading(
        "stored unsearched", "Keyframes that newer ones overtook: stored, and not searched for.", "keyframes"
    )
    forgotten: int = reading(
        "forgotten keyframes", "The oldest, which went for `max_keyframes` or `max_megabytes`.", "keyframes"
    )
    waiting_keyframes: int = reading("waiting keyframes", "Keyframes that wait for their search.", "keyframes")
    waiting_poses: int = reading(
        "waiting poses", "Likely poses that wait for other keyframes that agree (`confirm_seconds`).", "poses"
    )
    without_odometry: int = reading(
        "frames without odometry", "Frames that came, or are used, without odometry.", "frames"
    )
    localisation: str = reading(
        "localisation", "The state of [`localisation_state`](wire.md#localisation), and why; empty before a frame."
    )
    robots: Mapping[tuple[str, str], int] = family(
        "<robot>: keyframes <fate>",
        "With `robots`: the keyframes of each that were `received`, `searched` or `stored unsearched`.",
        "keyframes",
    )
    exchange: Mapping[str, int] = family(
        "exchange: <what>",
        "With `exchange`: summaries, requests, keyframes and bytes that were sent and received, and "
        "[what was given up](robots.md), as `dropped: <reason>`.",
    )
    constraints: int = reading("constraints", "Constraints that were published.", "constraints")
    confirmed: int = reading(
        "constraints confirmed by others", "Those of them with which other keyframes agreed.", "constraints"
    )
    withdrawn: int = reading("constraints withdrawn", "Retractions that were published, for vetoes.", "constraints")
    rejected: Mapping[str, int] = family(
        "rejected: <reason>", "Closures that were refused, by [reason](wire.md#why-a-closure-is-refused).", "refusals"
    )
    last_rejected: Mapping[str, str] = family(
        "last rejected: <reason>", "The numbers of the last one that was refused for this reason."
    )
    last_moved: Mapping[str, float] = family(
        "last moved: <label>",
        "How far an object was moved between the two keyframes of the last constraint that shows any.",
        "m",
        "{:.2f} m",
    )
