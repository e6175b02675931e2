# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import sys
from pathlib import Path

import pytest

from objreg_ros import share


@pytest.fixture
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The package as it lies in <prefix>/lib/python3.x/site-packages, without a checkout around it."""
    package = tmp_path / "prefix" / "lib" / "python3.x" / "site-packages" / "objreg_ros"
    package.mkdir(parents=True)
    monkeypatch.setattr(share, "__file__", str(package / "share.py"))
    monkeypatch.setattr(sys, "prefix", str(tmp_path / "nothing"))
    monkeypatch.delenv("AMENT_PREFIX_PATH", raising=False)
    return tmp_path


def put(folder: Path, relative: str) -> Path:
    path = folder / "share" / "objreg_ros" / relative
    path.parent.mkdir(parents=True)
    path.touch()
    return path


def test_a_checkout_is_served_from_itself(repository: Path) -> None:
    assert share.find("package.xml") == repository / "package.xml"


def test_files_beside_a_pip_installation_are_found(elsewhere: Path) -> None:
    expected = put(elsewhere / "prefix", "config/a.xml")
    assert share.find("config/a.xml") == expected


def test_files_beside_an_installation_into_a_target_folder_are_found(elsewhere: Path) -> None:
    expected = put(elsewhere / "prefix" / "lib" / "python3.x" / "site-packages", "config/a.xml")
    assert share.find("config/a.xml") == expected


def test_a_colcon_workspace_is_found_by_its_prefix(elsewhere: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    expected = put(elsewhere / "workspace", "config/a.xml")
    put(elsewhere / "prefix", "config/a.xml")
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"/opt/ros/jazzy:{elsewhere / 'workspace'}")
    assert share.find("config/a.xml") == expected


def test_what_is_nowhere_is_refused_with_every_place_that_was_tried(elsewhere: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"config/b\.xml: expected it at one of .*prefix/share/objreg_ros"):
        share.find("config/b.xml")


def test_a_model_is_a_path_or_a_name_in_the_users_folder_or_ours(
    elsewhere: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_DATA_HOME", str(elsewhere / "share"))
    ours = put(elsewhere / "prefix", "models/a.onnx")
    assert share.model("a.onnx") == ours
    users = put(elsewhere, "models/a.onnx")
    assert share.model("a.onnx") == users
    assert share.model(str(ours)) == ours


def test_without_a_name_a_fetched_model_of_coco_comes_before_the_embedded_one(
    elsewhere: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_DATA_HOME", str(elsewhere / "share"))
    embedded = put(elsewhere / "prefix", f"models/{share.EMBEDDED}")
    put(elsewhere, "models/other.onnx")
    assert share.model(share.AUTO) == embedded
    for name in reversed(share.COCO):  # the int8 one first
        fetched = share.user_models() / name
        fetched.touch()
        assert share.model(share.AUTO) == fetched


def test_a_model_of_a_name_that_is_nowhere_is_refused_with_how_to_get_one(
    elsewhere: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_DATA_HOME", str(elsewhere / "share"))
    with pytest.raises(FileNotFoundError, match=r"^a\.onnx: expected .* in .*share/objreg_ros/models or") as refused:
        share.model("a.onnx")
    assert "`objreg fetch-model` gets one" in str(refused.value) and "installed?" not in str(refused.value)


def test_a_model_that_is_named_with_its_folder_is_looked_for_there_only(elsewhere: Path) -> None:
    put(elsewhere / "prefix", "models/a.onnx")
    with pytest.raises(FileNotFoundError, match=r"^elsewhere/a\.onnx: expected a model file there, got none"):
        share.model("elsewhere/a.onnx")
