# SPDX-License-Identifier: Apache-2.0
"""The places of config/, launch/ and models/: in a checkout, in a colcon workspace or beside a pip installation."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from pathlib import Path

NAME = "objreg_ros"
AUTO = "auto"
EMBEDDED = "objreg_ssd.onnx"
COCO = ("ssd_mobilenet_v1_12.onnx", "ssd_mobilenet_v1_12-int8.onnx")  # as `objreg fetch-model` brings them


def checkout() -> Path | None:
    """The folder of the source where this very code lies in one; None where it is installed."""
    parent = Path(__file__).resolve().parents[1]
    return parent if (parent / "package.xml").is_file() else None


def folders() -> Iterator[Path]:
    """The places where the package's files may be, the one that belongs to this very code first."""
    package = Path(__file__).resolve().parent
    if (source := checkout()) is not None:
        yield source
    for prefix in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep):
        if prefix:
            yield Path(prefix) / "share" / NAME
    if len(package.parents) > 3:  # <prefix>/lib/python3.x/site-packages/objreg_ros
        yield package.parents[3] / "share" / NAME
    yield package.parent / "share" / NAME  # pip install --target
    yield Path(sys.prefix) / "share" / NAME


def find(relative: str) -> Path:
    """The installed file or folder, like ``config/fastdds.xml``; FileNotFoundError with every place that was tried."""
    tried = [folder / relative for folder in folders()]
    for path in tried:
        if path.exists():
            return path
    places = ", ".join(dict.fromkeys(map(str, tried)))
    raise FileNotFoundError(f"{relative}: expected it at one of {places}; is {NAME} installed?")


def user_models() -> Path:
    """The folder of the user's own models, by the XDG base directory specification; it need not exist."""
    return Path(os.environ.get("XDG_DATA_HOME") or "~/.local/share").expanduser() / NAME / "models"


def model(name: str) -> Path:
    """A model by its path, or by its file name in the user's data folder or in models/; else FileNotFoundError.

    `AUTO` is a COCO model that the user fetched, or the embedded one.
    """
    if name == AUTO:
        name = next((coco for coco in COCO if (user_models() / coco).is_file()), EMBEDDED)
    path = Path(name).expanduser()
    if path.is_file():
        return path
    if path.name != name:
        raise FileNotFoundError(f"{name}: expected a model file there, got none; `objreg fetch-model` gets one")
    places = [user_models() / name, *(folder / "models" / name for folder in folders())]
    for place in places:
        if place.is_file():
            return place
    raise FileNotFoundError(
        f"{name}: expected a model of this name in {user_models()} or in models/ of {NAME}, got none; `objreg "
        "fetch-model` gets one of COCO, ssd_mobilenet_v1_12.onnx, and one that lies elsewhere is named by its path"
    )
