# SPDX-License-Identifier: Apache-2.0
"""The parameters of the black box."""

from __future__ import annotations

from dataclasses import dataclass

from objreg_ros.data.closures import Reason
from objreg_ros.params import Params, param

MOST_SECONDS = 120.0
MEGABYTE = 1_000_000


@dataclass(frozen=True)
class BlackboxParams(Params):
    """How much is kept, what makes a file of it, and how much the folder of the files may hold."""

    blackbox_seconds: float = param(
        0.0,
        "the seconds of all inputs that a file holds; 0: off; 10 shows a keyframe before and after",
        "s",
        ge=0.0,
        le=MOST_SECONDS,
    )
    blackbox_reasons: tuple[str, ...] = param(
        ("camera_implausible", "neighbours_disagree"),
        "reasons of refusals that make a file; one file in blackbox_seconds at most",
        live=True,
    )
    blackbox_odds: float = param(
        0.0, "an accepted closure with smaller odds makes a file; 0: none does", ge=0.0, live=True
    )
    blackbox_folder: str = param(
        "~/.ros/objreg_blackbox", "the folder of the files; it is made where it is not there", at_start=True
    )
    blackbox_megabytes: float = param(
        2000.0, "most that the files in the folder hold together; the oldest go", "MB", ge=1.0, at_start=True
    )
    blackbox_memory: float = param(
        600.0, "most that is kept in memory; the oldest goes, and the file is shorter then", "MB", ge=1.0
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        known = {reason.value for reason in Reason}
        unknown = [name for name in self.blackbox_reasons if name not in known]
        if unknown:
            raise ValueError(f"blackbox_reasons: expected some of {', '.join(sorted(known))}, got {unknown[0]!r}")

    @property
    def most_kept(self) -> int:
        """The bytes that may be kept in memory: no more than a file may have."""
        return round(MEGABYTE * min(self.blackbox_memory, self.blackbox_megabytes))
