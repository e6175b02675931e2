# SPDX-License-Identifier: Apache-2.0
"""Compiled kernels have a place wherever the package is installed."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from objreg_ros import kernel_cache
from objreg_ros.kernel_cache import settle


@pytest.fixture
def nowhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A machine on which only the folder of temporary files can be written."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setattr(kernel_cache, "_is_writable", lambda folder: False)
    return tmp_path / f"objreg_kernels_{os.getuid()}"


def test_numba_chooses_for_itself_where_it_can(tmp_path: Path) -> None:
    environment = {"HOME": str(tmp_path)}
    settle(environment)
    assert environment == {"HOME": str(tmp_path)}


def test_a_folder_of_the_users_own_is_taken_where_nothing_else_can_be_written(nowhere: Path) -> None:
    environment: dict[str, str] = {}
    for _ in range(2):
        settle(environment)
        assert environment.pop("NUMBA_CACHE_DIR") == str(nowhere)
    assert nowhere.stat().st_mode & 0o777 == 0o700


def test_what_the_user_chose_stays(tmp_path: Path) -> None:
    environment = {"NUMBA_CACHE_DIR": str(tmp_path / "mine")}
    settle(environment)
    assert environment == {"NUMBA_CACHE_DIR": str(tmp_path / "mine")}


def test_what_the_user_chose_is_left_where_it_cannot_be_written(nowhere: Path) -> None:
    environment = {"NUMBA_CACHE_DIR": "/proc/mine"}
    settle(environment)
    assert environment == {"NUMBA_CACHE_DIR": str(nowhere)}


@pytest.mark.parametrize("how", ["others_write", "link", "file"])
def test_a_folder_that_others_could_have_filled_is_not_taken_but_a_new_one(
    nowhere: Path, tmp_path: Path, how: str
) -> None:
    if how == "others_write":
        nowhere.mkdir()
        nowhere.chmod(0o777)
    elif how == "link":
        (tmp_path / "theirs").mkdir()
        nowhere.symlink_to(tmp_path / "theirs")
    else:
        nowhere.touch()
    environment: dict[str, str] = {}
    settle(environment)
    taken = Path(environment["NUMBA_CACHE_DIR"])
    assert taken.parent == tmp_path and taken != nowhere and not list(taken.iterdir())
    assert taken.stat().st_mode & 0o777 == 0o700


def test_shared_memory_is_taken_where_no_temporary_folder_can_be_written(
    nowhere: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", "/proc/nothing")
    monkeypatch.setattr(kernel_cache, "SHARED_MEMORY", tmp_path)
    environment: dict[str, str] = {}
    settle(environment)
    assert Path(environment["NUMBA_CACHE_DIR"]).parent == tmp_path
    monkeypatch.setattr(kernel_cache, "SHARED_MEMORY", Path("/proc/nothing"))
    settle(environment := {})
    assert environment == {}


PROGRAM = """
from objreg_tools.cli.checks import compiled_code
from objreg_ros.segmenter.sensor import view

assert view._back_project.stats.cache_path.startswith({passing!r}) and not compiled_code().stops
"""


@pytest.mark.slow
@pytest.mark.skipif(os.getuid() != 0 or shutil.which("setpriv") is None, reason="needs root, and setpriv")
@pytest.mark.parametrize("is_taken", [False, True], ids=["free", "taken_by_another"])
def test_a_read_only_package_without_a_home_compiles_its_kernels(
    tmp_path: Path, repository: Path, is_taken: bool
) -> None:
    """Root may write what it may not, unless that is taken from it."""
    site, passing = tmp_path / "site", tmp_path / "passing"
    shutil.copytree(repository / "objreg_ros", site / "objreg_ros", ignore=shutil.ignore_patterns("__pycache__"))
    passing.mkdir()
    if is_taken:
        (passing / f"objreg_kernels_{os.getuid()}").mkdir()
        (passing / f"objreg_kernels_{os.getuid()}").chmod(0o777)
    for folder in (site, *(path for path in site.rglob("*") if path.is_dir())):
        folder.chmod(0o555)
    environment = {"PYTHONPATH": str(site), "TMPDIR": str(passing), "HOME": "/nonexistent"}
    environment |= {"XDG_CACHE_HOME": str(site / "objreg_ros"), "PATH": os.environ["PATH"]}
    program = PROGRAM.format(passing=str(passing))
    done = subprocess.run(
        ["setpriv", "--bounding-set", "-dac_override,-dac_read_search", sys.executable, "-c", program],
        env=environment, capture_output=True, text=True, cwd="/",
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert len(list(passing.glob("objreg_kernels_*"))) == 1  # a new folder is gone with its process
