# SPDX-License-Identifier: Apache-2.0
"""One door for every kind of recording."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from objreg_tools.recording.folders.record3d import Record3dRecording, is_record3d
from objreg_tools.recording.folders.scannet import ScanNetRecording, is_scannet
from objreg_tools.recording.folders.stray_scanner import StrayRecording, is_stray
from objreg_tools.recording.folders.text import require_regular
from objreg_tools.recording.folders.tum import TumRecording
from objreg_tools.recording.record import Recording
from objreg_tools.recording.rosbag.bag_files import METADATA, bag_files, is_bag
from objreg_tools.recording.rosbag.bags import BagRecording

EXPECTED = (
    "expected a rosbag1 file (.bag), a rosbag2 folder (metadata.yaml) or file (.mcap, .db3), a TUM RGB-D folder "
    "(rgb/, depth/ and associations.txt or rgb.txt and depth.txt), a folder of ScanNet or Stray "
    "Scanner, or a file (.r3d) or folder of Record3D"
)


def open_recording(path: Path | str) -> Recording:
    """The recording at ``path``, open. OSError if there is none, ValueError if it is broken: both say what to do."""
    place = Path(path).expanduser()
    if not place.exists():
        raise FileNotFoundError(f"{place}: no such file or folder; {EXPECTED}")
    if place.is_dir():
        return _open_folder(place)
    require_regular(place)
    if place.suffix.lower() == ".r3d":
        return Record3dRecording(place)
    if not is_bag(place):
        raise ValueError(f"{place}: {EXPECTED}, got a file {place.suffix or 'without a suffix'}")
    return BagRecording(place)


def _open_folder(folder: Path) -> Recording:
    bags = bag_files(folder)
    if bags and (folder / METADATA).exists():
        return BagRecording(folder)
    for fits, kind in FOLDERS:
        if fits(folder):
            return _beside(kind(folder), bags)
    if bags or (folder / METADATA).exists():
        return BagRecording(folder)
    got = ", ".join(sorted(file.name for file in folder.iterdir())[:5]) or "nothing"
    raise ValueError(f"{folder}: {EXPECTED}, got a folder with {got}")


def _is_tum(folder: Path) -> bool:
    return (folder / "rgb").is_dir() or (folder / "rgb.txt").exists()


FOLDERS: tuple[tuple[Callable[[Path], bool], Callable[[Path], Recording]], ...] = (
    (is_stray, StrayRecording),
    (is_record3d, Record3dRecording),
    (_is_tum, TumRecording),
    (is_scannet, ScanNetRecording),
)


def _beside(recording: Recording, bags: list[Path]) -> Recording:
    """The recording of pictures with a note on the bags that lie in its folder too."""
    if bags:
        recording.notes.append(f"also there, and not read: {', '.join(bag.name for bag in bags)}; name one to read it")
    return recording
