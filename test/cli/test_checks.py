# SPDX-License-Identifier: Apache-2.0
"""What the doctor sees of a machine on which something is missing."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from objreg_ros import native
from objreg_tools.cli import checks
from objreg_tools.cli.checks import Check


def only(found: list[Check]) -> Check:
    assert len(found) == 1
    return found[0]


def test_a_library_that_is_absent_stops_runs_and_its_package_is_named() -> None:
    check = only(list(checks.of_libraries({"libnowhere.so.9": "libnowhere9"})))
    assert (check.found, check.todo, check.stops) == ("absent", "sudo apt-get install libnowhere9", True)


def test_a_library_that_is_there_is_well() -> None:
    assert not only(list(checks.of_libraries({"libc.so.6": "libc6"}))).stops


def test_a_package_that_cannot_be_imported_stops_runs_in_its_own_words(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "broken_thing.py").write_text("raise OSError('libGL.so.1:\\n cannot open')\n")
    monkeypatch.syspath_prepend(tmp_path)
    check = only(list(checks.of_modules(["broken_thing"])))
    assert check.stops and check.found == "OSError: libGL.so.1: cannot open" and "scripts/bootstrap" in check.todo


def test_a_package_is_listed_with_its_version() -> None:
    check = only(list(checks.of_modules(["click"])))
    assert check.found[0].isdigit() and not check.todo


def test_an_extra_that_is_absent_is_advice(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "folder_thing").mkdir()  # a folder of this name is no package
    monkeypatch.syspath_prepend(tmp_path)
    check = only(list(checks.of_extras({"folder_thing": ("things", "what it is for")})))
    assert check.found == "absent" and not check.stops
    assert check.todo == "for what it is for: pip install 'objreg_ros[things]'"


def test_models_are_named_and_cocos_are_asked_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    default, coco, others = checks.of_models()
    assert default.found.endswith("objreg_ssd.onnx") and others.found == "none"
    assert coco.found == "none" and "objreg fetch-model" in coco.todo and not coco.stops
    models = tmp_path / "objreg_ros/models"
    models.mkdir(parents=True)
    for name in ("ssd_mobilenet_v1_12.onnx", "mine.onnx"):
        (models / name).touch()
    default, coco, others = checks.of_models()
    assert default.found.endswith("ssd_mobilenet_v1_12.onnx") and not coco.todo and others.found == "mine.onnx"


def test_without_any_model_no_run_can_work(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    monkeypatch.setattr("objreg_ros.share.folders", lambda: iter([tmp_path]))
    assert next(checks.of_models()).stops


def test_without_ros_the_live_graph_alone_is_out_of_reach(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(checks, "_trouble_of_import", lambda module: f"ModuleNotFoundError: {module}")
    check = only(list(checks.of_ros({})))
    assert not check.stops and "objreg_ros[ros]" in check.todo


def test_ros_is_listed_with_its_middleware_and_profile() -> None:
    pytest.importorskip("rclpy")
    found = {check.name: check.found for check in checks.of_ros({"ROS_DISTRO": "jazzy", "ROS_DOMAIN_ID": "7"})}
    assert found["found"].startswith("jazzy, ") and found["RMW"].startswith("rmw_") and found["ROS_DOMAIN_ID"] == "7"
    assert "Fast DDS" in found["profile"]


def test_a_middleware_that_cannot_be_loaded_is_advice() -> None:
    def ask() -> str:
        raise RuntimeError("no rmw_strange")

    assert checks._middleware(ask).todo.endswith("unset RMW_IMPLEMENTATION")


def test_a_disk_without_a_place_for_what_is_temporary_stops_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    def nowhere() -> str:
        raise FileNotFoundError(2, "No usable temporary directory found in ['/tmp']")

    monkeypatch.setattr("tempfile.gettempdir", nowhere)
    machine = {check.name: check for check in checks.of_machine()}
    check = machine["free disk for a while"]
    assert machine["compiled kernels"].found == native.chosen_build()
    assert check.stops and check.found.startswith("No usable temporary directory") and "TMPDIR" in check.todo


def test_a_disk_that_is_full_stops_runs(tmp_path: Path) -> None:
    assert not checks.free_disk("here", lambda: tmp_path, least=0).stops
    check = checks.free_disk("here", lambda: tmp_path, least=1 << 62)
    assert check.stops and check.todo.startswith("make room")


def test_shared_memory_of_killed_nodes_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(checks, "SHARED_MEMORY", tmp_path)
    assert "killed" not in checks._shared_memory().found
    segment = tmp_path / "fastrtps_0123456789abcdef"
    segment.write_bytes(bytes(3 << 20))
    segment.with_name(f"{segment.name}_el").touch()
    os.utime(segment, (0, 0))
    assert "3 MiB of killed nodes" in checks._shared_memory().found


def test_the_build_of_the_kernels_is_named_and_none_stops_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    assert checks.compiled_code().found in ("plain", "fast", "checked")

    def absent(file: str) -> None:
        raise ImportError("expected the kernels' build 'fast', got none: run  python setup.py build_ext --inplace")

    monkeypatch.setattr("objreg_ros.native.kernels", absent)
    check = checks.compiled_code()
    assert check.stops and "build_ext" in check.todo


def test_the_first_lines_say_what_this_is() -> None:
    names = [check.name for check in checks.of_package()]
    assert names == ["objreg_ros", "Python", "platform", "GPU"]
