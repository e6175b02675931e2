# SPDX-License-Identifier: Apache-2.0
"""The shared memory of Fast DDS whose process was killed: 24 MiB a node with config/fastdds_node.xml.

A process holds a lock on a file beside its segment for as long as it lives. After a kill both files stay until somebody
removes them, which Fast DDS leaves to its own tool, `fastdds shm clean`.
"""

from __future__ import annotations

import fcntl
import os
import re
import time
from contextlib import suppress
from pathlib import Path

FOLDER = Path("/dev/shm")
SEGMENT = re.compile(r"fastrtps_[0-9a-f]{16}")
LOCK = "_el"  # the file beside a segment that is locked has this after the segment's name
SETTLED_S = 10.0  # a process that starts makes its segment, and the file that it locks, one after the other


def abandoned(folder: Path = FOLDER, least_age_s: float = SETTLED_S) -> dict[Path, int]:
    """Segment → its bytes, of those that no process holds and that this user may remove; none without that folder."""
    latest = time.time() - least_age_s
    paths = [path for path in folder.glob("fastrtps_*") if SEGMENT.fullmatch(path.name)]
    return {path: size for path in paths if (size := _abandoned_bytes(path, latest)) is not None}


def free_abandoned(folder: Path = FOLDER, least_age_s: float = SETTLED_S) -> int:
    """Remove `abandoned` segments; how many bytes they were."""
    freed = 0
    for path, size in abandoned(folder, least_age_s).items():
        with suppress(OSError):  # another node that starts frees it too
            path.unlink()
            freed += size
            path.with_name(path.name + LOCK).unlink()
    return freed


def _abandoned_bytes(path: Path, latest: float) -> int | None:
    try:
        found = path.stat()
        if found.st_mtime > latest:
            return None
        file = os.open(path.with_name(path.name + LOCK), os.O_RDWR | os.O_CLOEXEC)
    except OSError:  # it is gone by now, or another user's
        return None
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return None
    finally:
        os.close(file)
    return found.st_size
