# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result
from merge.stores import ASIDE, BESIDE, HERE, PARAMS, two_stores

from objreg_ros.memory.store import Store, StoreError
from objreg_ros.memory.store_file import SCHEMA_VERSION
from objreg_ros.registrar.registrar import Registrar
from objreg_tools.cli import group
from objreg_tools.recording import Record, write_rosbag2
from objreg_tools.recording.rosbag import messages


@pytest.fixture(scope="module")
def stores(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    return two_stores(tmp_path_factory.mktemp("stores"))


def merged(stores: list[Path], out: Path, *words: str) -> Result:
    return CliRunner().invoke(group, ["merge", *map(str, stores), "-o", str(out), *words], catch_exceptions=False)


def true_path(folder: Path) -> Path:
    poses = [(0, HERE), (1, HERE), (30, BESIDE), (32, ASIDE)]
    write_rosbag2(folder, [Record.of("/gt", messages.pose_stamped(T, 10**9 * s, "world"), 10**9 * s) for s, T in poses])
    return folder


def test_two_stores_become_one_that_says_how_they_are_tied(stores: list[Path], tmp_path: Path) -> None:
    result = merged(stores, tmp_path / "both.db", "--json", str(tmp_path / "both.json"))
    assert result.exit_code == 0
    for text in ("between stores: 4 closures", "robot no name is west", "contradictions: none", "objreg inspect"):
        assert text in result.output
    found = json.loads((tmp_path / "both.json").read_text())
    assert found["complete"] and found["counts"]["keyframes"] == 4
    assert found["ties"] == [{"stores": [0, 1], "sessions": [0, 1], "robots": ["east", "west"], "closures": 4}]
    assert found["after"][0]["sessions"] == [0, 1] and [len(maps) for maps in found["before"]] == [1, 1]


def test_the_error_of_the_map_is_stated_where_the_truth_is_known(stores: list[Path], tmp_path: Path) -> None:
    truth = str(true_path(tmp_path / "truth"))
    result = merged(stores, tmp_path / "both.db", "--truth", truth, "--json", str(tmp_path / "both.json"))
    found = json.loads((tmp_path / "both.json").read_text())
    assert found["ties_error"] == {"of": 2, "false": 0} or found["ties_error"]["of"] > 0
    assert found["after"][0]["error_of_keyframes"] >= 3 and "cm from the truth" in result.output


def test_a_robot_that_is_not_there_has_no_truth(stores: list[Path], tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="expected one of the robots east, west, got 'north'"):
        merged(stores, tmp_path / "both.db", "--truth", f"north={true_path(tmp_path / 'truth')}")


def test_a_truth_without_a_pose_is_refused(stores: list[Path], tmp_path: Path) -> None:
    write_rosbag2(
        tmp_path / "bag", [Record.of("/image", messages.image(np.zeros((4, 6, 3), np.uint8), "rgb8", 5, "c"), 5)]
    )
    with pytest.raises(ValueError, match="expected a recording with the true path"):
        merged(stores, tmp_path / "both.db", "--truth", str(tmp_path / "bag"))


def test_one_store_named_twice_is_refused(stores: list[Path], tmp_path: Path) -> None:
    again = tmp_path / "again.db"
    again.symlink_to(stores[0])
    with pytest.raises(ValueError, match="which are one file"):
        merged([stores[0], again], tmp_path / "both.db")


def test_a_copy_of_a_store_is_refused(stores: list[Path], tmp_path: Path) -> None:
    copy = Path(shutil.copy(stores[0], tmp_path / "copy.db"))
    with pytest.raises(ValueError, match="share 2 keyframes"):
        merged([stores[0], copy], tmp_path / "both.db")


def test_one_store_alone_is_refused(stores: list[Path], tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="expected two stores or more, got 1"):
        merged(stores[:1], tmp_path / "both.db")


def test_a_store_that_a_registrar_writes_is_refused(stores: list[Path], tmp_path: Path) -> None:
    held = Path(shutil.copy(stores[0], tmp_path / "held.db"))
    registrar = Registrar(PARAMS.replaced(store=str(held)))
    try:
        with pytest.raises(StoreError, match=r"held\.db: in use by a registrar: .* got one of process \d+"):
            merged([stores[1], held], tmp_path / "both.db")
    finally:
        registrar.close()


def test_a_newer_store_is_refused_with_both_versions(stores: list[Path], tmp_path: Path) -> None:
    newer = Path(shutil.copy(stores[0], tmp_path / "newer.db"))
    with newer.open("r+b") as file:
        file.seek(60)
        file.write((99).to_bytes(4, "big"))
    with pytest.raises(StoreError, match=f"expected schema version {SCHEMA_VERSION} or older, got 99"):
        merged([stores[1], newer], tmp_path / "both.db")


def test_what_is_there_is_not_written_over(stores: list[Path], tmp_path: Path) -> None:
    (tmp_path / "both.db").write_text("mine")
    with pytest.raises(ValueError, match="expected a new file, got one that exists"):
        merged(stores, tmp_path / "both.db")
    with pytest.raises(ValueError, match="expected a place apart from all that is read"):
        merged(stores, stores[0])
    assert (tmp_path / "both.db").read_text() == "mine"


def test_what_is_interrupted_says_how_it_goes_on(
    stores: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise StoreError("both.db.unfinished: cannot write keyframe 2: database or disk is full")

    with monkeypatch.context() as patched:
        patched.setattr(Store, "write_keyframe", full)
        result = CliRunner().invoke(group, ["merge", *map(str, stores), "-o", str(tmp_path / "both.db")])
    assert isinstance(result.exception, StoreError)
    assert f"the same command goes on with {tmp_path}/both.db.unfinished" in result.output
    page = tmp_path / "both.html"
    assert merged(stores, tmp_path / "both.db", "--page", str(page)).exit_code == 0 and page.stat().st_size > 10_000
