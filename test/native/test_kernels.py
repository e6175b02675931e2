# SPDX-License-Identifier: Apache-2.0
"""How Python calls the kernels: builds, arguments, results."""

from __future__ import annotations

import gc
import importlib
import os
import re
import shutil
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

from objreg_ros import native
from objreg_ros.native import sources

PIXELS = np.array([0x01 << 4], np.uint8)  # a packed picture of one pixel without depth
PROJECT = native.kernels("registered_depth").project
UNPACK = native.kernels("rvl").unpack


def projected(depth: np.ndarray, across: np.ndarray | None = None) -> np.ndarray:
    height, width = depth.shape
    out = np.zeros((height, width, 3), np.float32)
    rays = np.zeros((3, width), np.float32) if across is None else across
    PROJECT(depth, rays, np.ones((3, height), np.float32), np.zeros(3, np.float32), np.ones(4, np.float32), out)
    return out


def test_an_array_with_gaps_is_read_as_it_is_seen() -> None:
    depth = np.arange(1, 49, dtype=np.float32).reshape(6, 8)
    np.testing.assert_array_equal(projected(depth[::2, ::2]), projected(depth[::2, ::2].copy()))
    np.testing.assert_array_equal(projected(depth.T), projected(depth.T.copy()))
    np.testing.assert_array_equal(projected(depth[::-1]), projected(depth[::-1].copy()))


def test_an_empty_array_is_no_error() -> None:
    assert projected(np.zeros((0, 8), np.float32)).shape == (0, 8, 3)


@pytest.mark.parametrize(
    ("depth", "got"),
    [
        (np.zeros((2, 2)), "2 of 'd8'"),
        (np.zeros((2, 2), np.int32), "2 of 'i4'"),
        (np.zeros(2, np.float32), "1 of 'f4'"),
    ],
)
def test_another_type_or_number_of_axes_is_refused(depth: np.ndarray, got: str) -> None:
    out = np.zeros((2, 2, 3), np.float32)
    rays = np.zeros((3, 2), np.float32)
    with pytest.raises(TypeError, match=rf"expected an array of 2 axes, 'f4', .* got {got}"):
        PROJECT(depth, rays, rays, np.zeros(3, np.float32), np.ones(4, np.float32), out)


def test_an_array_to_be_filled_is_written_in_place_or_refused() -> None:
    words, pixels = np.zeros(4, np.uint32), np.ones(4, np.uint16)
    with pytest.raises(TypeError, match="the last without gaps"):
        UNPACK(words, pixels[::2])
    pixels.flags.writeable = False
    with pytest.raises(ValueError, match="read-only"):
        UNPACK(words, pixels)


def test_another_number_of_arguments_is_refused() -> None:
    with pytest.raises(TypeError, match="expected 2 arguments, got 1"):
        UNPACK(np.zeros(1, np.uint32))


def test_what_a_kernel_makes_lives_as_long_as_it_is_used() -> None:
    equations = native.kernels("turn").equations
    grey = np.random.default_rng(0).random((12, 16)).astype(np.float32)
    slope, camera = np.ones((12, 16, 2), np.float32), np.array([16.0, 16.0, 8.0, 6.0])
    results = [equations(grey, camera, np.eye(3), grey, slope, camera)[0] for _ in range(100)]
    gc.collect()
    assert all(np.array_equal(result, results[0]) for result in results) and results[0].dtype == np.float64
    assert results[0].flags.writeable


def test_other_threads_run_while_a_kernel_does() -> None:
    words, pixels = np.full(1 << 20, 0x77777777, np.uint32), np.zeros(1 << 23, np.uint16)
    depth, ran = np.ones((2000, 2000), np.float32), threading.Event()
    thread = threading.Thread(target=ran.set)
    sys.setswitchinterval(60.0)
    try:
        thread.start()
        projected(depth)
        UNPACK(words, pixels)
        assert ran.wait(60.0)
    finally:
        sys.setswitchinterval(0.005)
        thread.join()


def test_every_file_of_kernels_is_listed_with_what_it_has(repository: Path) -> None:
    headers = [path for path in sources.source_files(repository) if "METHODS[]" in path.read_text()]
    listed = (repository / "objreg_ros/native/files.hpp").read_text()
    for header in headers:
        assert f'{{"{header.stem}", {header.stem}::METHODS}}' in listed
        found = [name for name in vars(native.kernels(header.stem)) if not name.startswith("__")]
        assert found and all(f'("{name}"' in header.read_text() for name in found)
    assert len(headers) == listed.count("::METHODS}")


def test_a_number_that_stands_in_a_header_and_beside_it_is_the_same(repository: Path) -> None:
    stated = re.compile(r"^constexpr \w+ (\w+) = (-?[\d.]+)f?;", re.MULTILINE)
    found = 0
    for header in sources.source_files(repository):
        beside = header.parents[1] / f"{header.stem}.py"
        python = beside.read_text() if beside.exists() else ""
        for name, value in stated.findall(header.read_text()):
            there = re.search(rf"^{name} = (?:np\.float32\()?(-?[\d.]+)", python, re.MULTILINE)
            found += there is not None
            assert there is None or float(there[1]) == float(value), f"{name} of {header}"
    assert found >= 4


def test_the_builds_of_one_processor_agree() -> None:
    plain = importlib.import_module("objreg_ros.native.plain")
    rng = np.random.default_rng(1)
    words, results = rng.integers(0, 1 << 32, 4000, dtype=np.uint32), []
    for build in (plain.rvl, native.kernels("rvl")):
        pixels = np.zeros(20000, np.uint16)
        results.append((build.unpack(words, pixels), pixels))
    assert results[0][0] == results[1][0]
    np.testing.assert_array_equal(results[0][1], results[1][1])


def test_kernels_of_other_sources_are_refused_with_the_command_that_builds_them(
    repository: Path, tmp_path: Path
) -> None:
    shutil.copytree(repository / "objreg_ros/native", tmp_path / "objreg_ros/native")
    (tmp_path / "objreg_ros/__init__.py").touch()
    read = "from objreg_ros.native import kernels; kernels('rvl')"

    def complaint() -> str:
        done = subprocess.run([sys.executable, "-c", read], cwd=tmp_path, env={}, capture_output=True, text=True)
        return done.stderr.splitlines()[-1]

    assert "expected kernels built of the sources" in complaint()
    assert "run  python setup.py build_ext --inplace  in" in complaint()
    for built in (tmp_path / "objreg_ros/native").glob("*.so"):
        built.unlink()
    assert "got none: run" in complaint() and "g++" in complaint()


@pytest.fixture(scope="module")
def unbuilt(repository: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A checkout in which nothing was compiled."""
    folder = tmp_path_factory.mktemp("unbuilt")
    for package in ("objreg_ros", "objreg_mapper", "objreg_tools"):
        shutil.copytree(repository / package, folder / package, ignore=shutil.ignore_patterns("*.so", "__pycache__"))
    return folder


@pytest.mark.parametrize(
    "words",
    [
        ("objreg_tools", "offline", "recording"),
        ("objreg_tools", "try", "--help"),
        ("objreg_tools.graph",),
        ("objreg_ros.detector.node",),
        ("objreg_ros.registrar.node",),
    ],
)
def test_whoever_starts_without_kernels_reads_one_line_with_the_command_that_builds_them(
    words: tuple[str, ...], unbuilt: Path
) -> None:
    if words[0] != "objreg_tools":
        pytest.importorskip("rclpy", reason="ROS is not installed")
    command = [sys.executable, "-m", *words]
    environment = {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "OBJREG_CHECKED")}
    done = subprocess.run(command, cwd=unbuilt, env=environment, capture_output=True, text=True)
    line = " ".join(done.stderr.split())
    assert done.returncode == 1 and not done.stdout and done.stderr.count("\n") == 1, done.stderr
    assert "expected the kernels' build" in line and f"run {native.BUILD} in {unbuilt}" in line


def test_other_errors_keep_their_traceback_beside_kernels_that_are_not_built(unbuilt: Path) -> None:
    code = "from objreg_ros import native\ntry:\n    native.kernels('rvl')\nexcept ImportError:\n    raise KeyError(1)"
    done = subprocess.run([sys.executable, "-c", code], cwd=unbuilt, env={}, capture_output=True, text=True)
    assert done.returncode == 1 and "Traceback" in done.stderr and "KeyError: 1" in done.stderr


def test_a_build_is_marked_with_names_and_contents_of_its_sources(tmp_path: Path) -> None:
    folder = tmp_path / "objreg_ros/native"
    folder.mkdir(parents=True)
    marks = [sources.fingerprint(tmp_path)]
    for name, text in (("a.hpp", "1"), ("a.hpp", "2"), ("b.cpp", "2"), ("notes.txt", "3")):
        (folder / name).write_text(text)
        marks.append(sources.fingerprint(tmp_path))
    assert len(set(marks[:4])) == 4 and marks[4] == marks[3]
