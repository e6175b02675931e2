# SPDX-License-Identifier: Apache-2.0
"""What the black box reports beside what nodes have in common. Its frames are files."""

from __future__ import annotations

from dataclasses import dataclass

from objreg_ros.diagnostics import Diagnostics, reading


@dataclass(frozen=True, kw_only=True)
class BlackboxDiagnostics(Diagnostics):
    """What is kept, and what was written."""

    kept_messages: int = reading("kept messages", "Messages in memory.", "messages")
    kept_bytes: float = reading("kept [MB]", "Their size.", "MB", "{:.1f}")
    kept_seconds: float = reading("kept [s]", "The time that they span.", "s", "{:.1f}")
    jumps: int = reading("time jumps", "Times that the clock went back, and what was kept was forgotten.", "jumps")
    passed_over: int = reading(
        "events passed over", "Events that came less than `blackbox_seconds` after one that made a file.", "events"
    )
    removed: int = reading("files removed", "The oldest, which went for `blackbox_megabytes`.", "files")
    last_file: str | None = reading("last file", "The file that was written last.", default=None)
