# SPDX-License-Identifier: Apache-2.0
"""What a run was made with, so that a reader of its report can repeat it."""

from __future__ import annotations

import shlex
import subprocess
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from hashlib import sha256
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from objreg_ros import share
from objreg_ros.detector.threshold import own_threshold

DIGITS = 12  # of a commit and of a model's digest: enough to distinguish them
PATIENCE_S = 5.0  # for git


def about(recording: Path, model: str, params: Mapping[str, Any], arguments: Sequence[str]) -> dict[str, Any]:
    """Version, commit, command, date, recording, model and the parameters that are not the defaults, as JSON.

    ``arguments`` are those of `objreg`. OSError where there is no such model.
    """
    file = share.model(model)
    return {
        "version": version(),
        "commit": commit(share.checkout()),
        "command": shlex.join(["objreg", *arguments]),
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
        "recording": str(recording.resolve()),
        "model": {
            "name": file.name,
            "sha256": sha256(file.read_bytes()).hexdigest()[:DIGITS],
            "threshold": params.get("detector.threshold") or own_threshold(file),
        },
        "params": dict(params),
    }


def version() -> str:
    """The version of this package, as package.xml says; empty where that is not installed."""
    try:
        return ElementTree.parse(share.find("package.xml")).findtext("version", "")
    except (OSError, ElementTree.ParseError):
        return ""


def commit(folder: Path | None) -> str | None:
    """The commit that is checked out in a folder, with ``-dirty`` where files differ; None where git knows of none."""
    if folder is None or not (folder / ".git").exists():
        return None
    asked = ["git", "-C", str(folder), "describe", "--always", "--dirty", "--exclude=*", f"--abbrev={DIGITS}"]
    try:
        done = subprocess.run(asked, capture_output=True, text=True, timeout=PATIENCE_S, check=True)
    except (OSError, subprocess.SubprocessError):
        return None
    return done.stdout.strip() or None
