# SPDX-License-Identifier: Apache-2.0
"""One door for every kind of recording."""

from __future__ import annotations

from pathlib import Path

from objreg_ros.recording.bags import BagRecording
from objreg_ros.recording.record import Recording
from objreg_ros.recording.text import require_regular
from objreg_ros.recording.tum import TumRecording

EXPECTED = (
    "expected a rosbag1 file (.bag), a rosbag2 folder (metadata.yaml) or file (.mcap, .db3), or a TUM RGB-D folder "
    "(rgb/, depth/ and associations.txt or rgb.txt and depth.txt)"
)
BAG_FILES = (".bag", ".mcap", ".db3")


def open_recording(path: Path | str) -> Recording:
    """The recording at ``path``, open. OSError if there is none, ValueError if it is broken: both say what to do."""
    place = Path(path).expanduser()
    if not place.exists():
        raise FileNotFoundError(f"{place}: no such file or folder; {EXPECTED}")
    if place.is_dir():
        return _open_folder(place)
    require_regular(place)
    if place.suffix not in BAG_FILES:
        raise ValueError(f"{place}: {EXPECTED}, got a file {place.suffix or 'without a suffix'}")
    return BagRecording(place)


def _open_folder(folder: Path) -> Recording:
    if (folder / "metadata.yaml").exists():
        return BagRecording(folder)
    if (folder / "rgb").is_dir() or (folder / "rgb.txt").exists():
        return TumRecording(folder)
    bags = sorted(file for file in folder.iterdir() if file.suffix in BAG_FILES)
    if len(bags) == 1:
        return BagRecording(bags[0])
    got = ", ".join(sorted(file.name for file in folder.iterdir())[:5]) or "nothing"
    raise ValueError(f"{folder}: {EXPECTED}, got a folder with {got}")
