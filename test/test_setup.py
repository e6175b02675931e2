# SPDX-License-Identifier: Apache-2.0
"""The wheel: what it says of itself, what it holds, and that it runs without the checkout."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import venv
from collections.abc import Iterator
from email.message import Message
from email.parser import Parser
from pathlib import Path, PurePath
from zipfile import ZipFile

import numpy
import pytest

PACKAGES = ("objreg_ros", "objreg_mapper", "objreg_tools")
SOURCES = ("setup.py", "setup.cfg", "README.md", "LICENSE", "package.xml")
FOLDERS = ("resource", "config", "launch", "models", *PACKAGES)
LEFT_OUT = ("__pycache__", "*.nbi", "*.nbc", "*.so")
RUN = """
from pathlib import Path
import objreg_ros
from objreg_ros import register, share
print(Path(objreg_ros.__file__).parent)
print(share.find("models/objreg_ssd.onnx"), share.find("config/objreg.yaml"))
"""


@pytest.fixture(scope="module")
def wheel(repository: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Built from a copy: setuptools leaves what it makes beside what it builds."""
    source, out = tmp_path_factory.mktemp("source"), tmp_path_factory.mktemp("wheel")
    for name in SOURCES:
        shutil.copy(repository / name, source / name)
    for name in FOLDERS:
        shutil.copytree(repository / name, source / name, ignore=shutil.ignore_patterns(*LEFT_OUT))
    words = ("wheel", "--no-deps", "--no-build-isolation", "--no-cache-dir", "--disable-pip-version-check")
    output_of(sys.executable, "-m", "pip", *words, "--wheel-dir", str(out), str(source))
    (made,) = out.glob("*.whl")
    return made


def output_of(*command: str, cwd: Path | None = None) -> str:
    """The output of a command, which knows nothing of the checkout."""
    outside = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    done = subprocess.run(command, cwd=cwd, env=outside, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def metadata(wheel: Path) -> Message:
    with ZipFile(wheel) as archive:
        (name,) = [name for name in archive.namelist() if name.endswith(".dist-info/METADATA")]
        return Parser().parsestr(archive.read(name).decode())


def files(repository: Path, *folders: str) -> Iterator[PurePath]:
    """The files of some folders, without what programs leave there."""
    for folder in folders:
        for path in sorted((repository / folder).rglob("*")):
            if path.is_file() and path.suffix not in {".nbi", ".nbc", ".pyc", ".so"}:
                yield path.relative_to(repository)


def test_the_wheel_says_what_it_is(repository: Path, wheel: Path) -> None:
    said = metadata(wheel)
    released = re.search(r"^## \[(\d+\.\d+\.\d+)\] - ", (repository / "CHANGELOG.md").read_text(), re.MULTILINE)
    assert released is not None and said["Version"] == released[1]
    assert said["Description-Content-Type"] == "text/markdown"
    assert str(said.get_payload()).strip() == (repository / "README.md").read_text().strip()
    urls = [url.split(", ")[1] for url in said.get_all("Project-URL", [])]
    assert len(urls) >= 4 and all(url.startswith("https://objreg-ros.invalid") for url in urls)
    assert said["License-Expression"] == "Apache-2.0" or said["License"] == "Apache-2.0"
    assert said.get_all("License-File") == ["LICENSE"]
    assert {"Typing :: Typed", "Programming Language :: Python :: 3.11"} <= set(said.get_all("Classifier", []))


def test_the_wheel_holds_every_file_of_the_package_and_of_its_share(repository: Path, wheel: Path) -> None:
    with ZipFile(wheel) as archive:
        held = set(archive.namelist())
    (data,) = {name.partition("/")[0] for name in held if ".data/" in name}
    share = f"{data}/data/share/objreg_ros"
    wanted = {str(path) for path in files(repository, *PACKAGES)} | {f"{package}/py.typed" for package in PACKAGES}
    wanted |= {f"{share}/{path}" for path in files(repository, "config", "launch", "models")}
    wanted |= {f"{share}/package.xml", f"{share}/LICENSE", "objreg_ros/native/plain.abi3.so"}
    assert wanted <= held, f"the wheel lacks {sorted(wanted - held)}"
    assert not [name for name in held if name.startswith(("test", "benchmarks", "training"))]


def test_the_wheel_runs_in_a_venv_that_has_only_it_and_what_it_asks_for(wheel: Path, tmp_path: Path) -> None:
    venv.create(tmp_path / "venv", symlinks=True)
    binaries, (packages,) = tmp_path / "venv/bin", list((tmp_path / "venv/lib").glob("*/site-packages"))
    words = ("install", "--no-deps", "--no-index", "--no-compile", "--disable-pip-version-check", str(wheel))
    output_of(sys.executable, "-m", "pip", "--python", str(binaries / "python"), *words)
    (packages / "asked_for.pth").write_text(f"{Path(numpy.__file__).parents[1]}\n")
    assert "offline" in output_of(str(binaries / "objreg"), "--help", cwd=tmp_path)
    home, *shared = output_of(str(binaries / "python"), "-c", RUN, cwd=tmp_path).split()
    assert Path(home) == packages / "objreg_ros"
    assert len(shared) == 2 and all(Path(path).is_relative_to(tmp_path / "venv/share") for path in shared)
