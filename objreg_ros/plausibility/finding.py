# SPDX-License-Identifier: Apache-2.0
"""What was found of a recording or of a run, why it is likely so, and what to do."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Finding:
    """What is seen, its likeliest cause, and what to do next.

    ``anchor`` is the section of docs/troubleshooting.md that says more. Without one it is a remark, like that of
    odometry that is not there: nothing is wrong with a run of it. Cause and what to do are empty where all is said.
    """

    what: str
    cause: str = ""
    todo: str = ""
    anchor: str = ""

    @property
    def text(self) -> str:
        """All of it in one line."""
        text = f"{self.what}: {self.cause}" if self.cause else self.what
        return f"{text}; {self.todo}" if self.todo else text
