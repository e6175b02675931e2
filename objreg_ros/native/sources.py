# SPDX-License-Identifier: Apache-2.0
"""The sources of the kernels: which files they are, and the checksum that a build is marked with."""

from __future__ import annotations

import hashlib
from pathlib import Path

PACKAGES = "objreg_ros", "objreg_tools"


def source_files(root: Path) -> list[Path]:
    """The headers and sources in the ``native`` folders of the packages below ``root``, in order of their names."""
    return sorted(
        path for package in PACKAGES for path in (root / package).rglob("native/*") if path.suffix in (".hpp", ".cpp")
    )


def fingerprint(root: Path) -> str:
    """The first digits of the SHA-256 of all sources, with their names."""
    total = hashlib.sha256()
    for path in source_files(root):
        total.update(path.relative_to(root).as_posix().encode() + b"\0" + path.read_bytes())
    return total.hexdigest()[:16]
