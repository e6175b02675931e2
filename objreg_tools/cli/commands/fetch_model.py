# SPDX-License-Identifier: Apache-2.0
"""`objreg fetch-model`: get a detector model into the user's data folder, where the parameter `model` finds it."""

from __future__ import annotations

import hashlib
import os
import shutil
from dataclasses import dataclass
from http.client import HTTPException
from pathlib import Path, PurePosixPath
from urllib.parse import urlsplit

import click

from objreg_ros import share
from objreg_ros.detector.runtime import Runtime
from objreg_ros.detector.threshold import own_threshold
from objreg_tools.cli.download import download
from objreg_tools.cli.paths import OutputPath

ZOO = "validated/vision/object_detection_segmentation/ssd-mobilenetv1/model"
MIRRORS = (
    f"https://huggingface.co/onnxmodelzoo/legacy_models/resolve/main/{ZOO}",
    f"https://media.githubusercontent.com/media/onnx/models/main/{ZOO}",
)


@dataclass(frozen=True)
class ModelSource:
    """A file that several places offer: its name here, its SHA-256 where it is known, the labels it needs.

    Beside the labels is its threshold, as JSON.
    """

    file: str
    urls: tuple[str, ...]
    sha256: str = ""
    labels: str = ""


def _of_zoo(file: str, sha256: str) -> ModelSource:
    return ModelSource(file, tuple(f"{mirror}/{file}" for mirror in MIRRORS), sha256, "models/coco.txt")


MODELS = {
    "ssd-mobilenet-v1": _of_zoo(
        "ssd_mobilenet_v1_12.onnx", "b8fba5e404077d4048d27fcd1667e85e27e192eb9bf51e696c46a3acd7d21058"
    ),
    "ssd-mobilenet-v1-int8": _of_zoo(
        "ssd_mobilenet_v1_12-int8.onnx", "45af75d9ddb063744277887ee27a658f7759980f7c1a87e21b53a11e7ae59627"
    ),
}
"""The models by name: the COCO models of the ONNX model zoo (Apache-2.0)."""


@click.command()
@click.argument("what", default="ssd-mobilenet-v1", metavar="[NAME|URL]")
@click.option("--sha256", default="", help="The checksum that the file of a URL must have.")
@click.option("--folder", type=OutputPath(path_type=Path, file_okay=False), help="Where to; default: the user's data.")
def command(what: str, sha256: str, folder: Path | None) -> None:
    """Get a detector model, by NAME or from a URL.

    An interrupted download goes on where it stopped. Names: ssd-mobilenet-v1 (the default), ssd-mobilenet-v1-int8.
    """
    source = find_source(what, sha256)
    path = (folder or share.user_models()) / source.file
    if path.is_file() and (not source.sha256 or checksum(path) == source.sha256):
        click.echo(f"{path} is already there")
    else:
        fetch(source, path)
    if source.labels:
        for end in (".txt", ".json"):
            shutil.copyfile(share.find(source.labels).with_suffix(end), path.with_suffix(end))
    click.echo(f"its threshold is {own_threshold(path):g}, unless detector.threshold is set")
    click.echo(f"use it with: --model {path.name}" if folder is None else f"use it with: --model {path}")


def find_source(what: str, sha256: str = "") -> ModelSource:
    """The source of a name or a URL; ValueError when it is neither."""
    if what in MODELS:
        return MODELS[what]
    parts = urlsplit(what)
    file = PurePosixPath(parts.path).name
    if parts.scheme not in ("http", "https") or not file.endswith(".onnx"):
        raise ValueError(f"model: expected {', '.join(MODELS)}, or the http(s) URL of an .onnx file, got {what!r}")
    if parts.scheme == "http" and not sha256:
        raise ValueError(
            f"model: expected https, or --sha256 with the checksum of the file, got {what!r} without one: "
            "over http anybody on the way can change the file; ask its maker for the checksum"
        )
    return ModelSource(file, (what,), sha256.lower())


def fetch(source: ModelSource, path: Path) -> None:
    """Download ``source`` to ``path``, which is only written complete, with the right checksum and loadable.

    ValueError when no place has it, or when it is something else; what has arrived of it stays for the next time.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(path.name + ".part")
    failures = []
    for url in source.urls:
        try:
            download(url, part, bool(source.sha256))
            break
        except (OSError, HTTPException) as error:
            failures.append(f"{url}: {getattr(error, 'reason', None) or error}")
    else:
        labels = " and run this again, which adds its labels" if source.labels else " and its labels beside it as .txt"
        raise ValueError(
            f"{source.file}: expected a download, got {'; '.join(failures)}. Are you online? Behind a proxy, set "
            f"HTTPS_PROXY; or get the file elsewhere, put it at {path}{labels}. Try again to go on where it stopped"
        )
    _accept(part, source)
    os.replace(part, path)


def checksum(path: Path) -> str:
    """The SHA-256 of a file in hexadecimal."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _accept(part: Path, source: ModelSource) -> None:
    """ValueError, and the file is gone, when it is not what was asked for."""
    got = checksum(part)
    try:
        if source.sha256 and got != source.sha256:
            raise ValueError(f"{source.file}: expected SHA-256 {source.sha256}, got {got}; it was removed, try again")
        Runtime(part, threads=1)
    except ValueError:
        part.unlink()
        raise
    if not source.sha256:
        click.echo(f"SHA-256 {got}")
