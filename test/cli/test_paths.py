# SPDX-License-Identifier: Apache-2.0
"""No command writes over what it reads, nor twice into one file; the types of its options say what is which."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click
import pytest
from click.testing import CliRunner
from recording.sample_folders import tum_folder

from objreg_ros import share
from objreg_tools.cli import group, paths
from objreg_tools.cli.paths import INPUTS, OutputPath, require_apart, require_writable

CONTENT = b"what must stay"
NAMES_NO_FILE = {
    "remaps",
    "odometry",
    "detections",
    "scheduler",
    "what",
    "form",
    "ids",
    *("first", "second"),  # times of pair
    "sha256",
    "intrinsics",
    "pairs",
    "size",
    "lens",
    "settings",
    "label",  # of where
    *("namespace", "robots", "exchange", "sources", "enclaves", "remap", "robot", "source"),  # of policy
}
"""Texts of options that are never opened."""


def commands() -> dict[str, click.Command]:
    context = click.Context(group)
    found = {name: group.get_command(context, name) for name in group.list_commands(context)}
    return {name: command for name, command in found.items() if command is not None}


def outputs() -> Iterator[tuple[str, str]]:
    """Every output of every command."""
    for name, command in commands().items():
        yield from ((name, p.name or "") for p in command.params if isinstance(p.type, OutputPath))


def run(*words: object) -> None:
    """The command as `main` runs it; what it raises."""
    CliRunner().invoke(group, [str(word) for word in words], catch_exceptions=False, standalone_mode=False)


@pytest.fixture
def kept(tmp_path: Path) -> Path:
    file = tmp_path / "kept"
    file.write_bytes(CONTENT)
    return file


def test_every_path_of_a_command_is_known_as_read_or_written_and_watched() -> None:
    for name in commands():
        command = commands()[name]
        for parameter in command.params:
            if isinstance(parameter.type, click.Path | click.File):
                assert isinstance(parameter.type, (*INPUTS, OutputPath)), parameter.name
            elif parameter.type is click.STRING:
                assert parameter.name in NAMES_NO_FILE, f"{parameter.name}: give it a type of cli/paths.py"
        assert hasattr(command.callback, "is_guarded"), name


def test_no_output_of_any_command_takes_the_place_of_any_of_its_inputs(kept: Path) -> None:
    for name, output in list(outputs()):
        command = commands()[name]
        inputs = [p for p in command.params if isinstance(p.type, INPUTS)]
        assert inputs or name in ("simulate", "fetch-model"), name
        for parameter in inputs:
            read: Any = kept if isinstance(parameter.type, click.Path) else f"detector.model={kept}"
            several = parameter.multiple or parameter.nargs == -1
            if isinstance(parameter.type, paths.SettingsPath):
                kept.write_text("{}")
            given = {parameter.name or "": (read,) if several else read, output: kept}
            with pytest.raises(ValueError, match=r"expected a place apart from all that is read, got .*kept, of "):
                require_apart(command, given)


def test_no_two_outputs_of_any_command_are_one_file(tmp_path: Path) -> None:
    for name, output in list(outputs()):
        others = [other for command, other in outputs() if command == name and other != output]
        for other in others:
            with pytest.raises(ValueError, match=r"expected a file of its own, got that of --"):
                require_apart(commands()[name], {output: tmp_path / "one", other: tmp_path / "x" / ".." / "one"})


def disguised(kept: Path, folder: Path) -> Iterator[Path]:
    """Other names of a file."""
    yield folder / "nowhere" / ".." / kept.name
    yield Path(os.path.relpath(kept))
    (folder / "link").symlink_to(kept)
    yield folder / "link"
    (folder / "folder").symlink_to(folder, target_is_directory=True)
    yield folder / "folder" / kept.name
    (folder / "hard").hardlink_to(kept)
    yield folder / "hard"


def test_a_link_and_a_detour_lead_to_the_file_itself(kept: Path, tmp_path: Path) -> None:
    for name in disguised(kept, tmp_path):
        with pytest.raises(ValueError, match="expected a place apart"):
            run("report", kept, "--out", name)
    assert kept.read_bytes() == CONTENT


def test_a_store_a_model_and_a_run_are_not_written_over(kept: Path, tmp_path: Path) -> None:
    for words in (
        ("inspect", kept, "--page", kept),
        ("inspect", kept, "--picture", f"{kept}-wal"),
        ("offline", kept, "--json", kept),
        ("offline", tmp_path / "bag", "--model", kept, "--g2o", kept),
        ("offline", tmp_path / "bag", "--set", f"registrar.store={kept}", "--tum", kept),
        ("offline", tmp_path / "bag", "--camera", kept, "--rerun", kept),
        ("offline", tmp_path / "bag", "--g2o", share.model(share.AUTO)),
        ("report", kept, "--out", kept),
        ("batch", tmp_path, "--out", tmp_path),
        ("sweep", tmp_path, "--out", tmp_path),
    ):
        with pytest.raises(ValueError, match="expected a place apart"):
            run(*words)
    assert kept.read_bytes() == CONTENT


def test_what_a_parameter_file_names_is_read_too(kept: Path, tmp_path: Path) -> None:
    settings = tmp_path / "settings.yaml"
    settings.write_text(f"detector:\n  ros__parameters:\n    labels: {kept}\n")
    with pytest.raises(ValueError, match=r"--tum: expected a place apart .*, of --params"):
        run("offline", tmp_path / "bag", "--params", settings, "--tum", kept)


def test_labels_beside_a_model_are_read_with_it(kept: Path, tmp_path: Path) -> None:
    (tmp_path / "kept.txt").write_text("cup")
    with pytest.raises(ValueError, match=r"kept\.txt, of --model"):
        run("offline", tmp_path / "bag", "--model", kept, "--kitti", tmp_path / "kept.txt")


def test_nothing_is_written_into_the_folder_of_a_recording(tmp_path: Path) -> None:
    folder, bag = tum_folder(tmp_path / "tum"), tmp_path / "bag"
    bag.mkdir()
    (bag / "metadata.yaml").touch(), (bag / "bag_0.mcap").touch()
    for words in (
        ("offline", folder, "--json", folder / "rgb.txt"),
        ("convert", folder, folder / "bag"),
        ("offline", bag / "bag_0.mcap", "--mcap", bag / "bag_1.mcap"),
        ("batch", folder, "--out", folder / "deep" / "out"),
        ("batch", bag, "--out", folder, "--against", folder),
        ("sweep", folder, "--out", folder / "deep" / "out"),
    ):
        with pytest.raises(ValueError, match="expected a place apart"):
            run(*words)


def test_a_device_and_standard_output_may_be_named_twice(tmp_path: Path) -> None:
    null = Path("/dev/null")
    require_apart(commands()["offline"], {"recording": tmp_path, "tum": null, "kitti": null, "json_file": Path("-")})


def test_a_text_that_names_no_file_keeps_no_output_from_its_place(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    given = {
        "recording": Path("bag"),
        "camera": "1,2,3,4",
        "changes": ("registrar.seed=7", "detector.model="),
        "model": "x" * 5000,
    }
    require_apart(commands()["offline"], {**given, "tum": Path("tum.txt"), "json_file": Path("run.json")})


def test_a_file_that_can_be_written_is_not_touched(tmp_path: Path) -> None:
    require_writable("--out", tmp_path / "new.html")
    assert not (tmp_path / "new.html").exists()
    (tmp_path / "old.html").write_text("old")
    require_writable("--out", tmp_path / "old.html")
    assert (tmp_path / "old.html").read_text() == "old"


@pytest.mark.parametrize(
    ("name", "option"), [("demo", "out"), ("simulate", "out"), ("convert", "out"), ("batch", "out"), ("sweep", "out")]
)
def test_a_folder_is_made_with_those_above_it(name: str, option: str, tmp_path: Path) -> None:
    require_apart(commands()[name], {option: tmp_path / "none/yet/here"})
    assert not (tmp_path / "none").exists()
    (tmp_path / "a_file").touch()
    with pytest.raises(OSError, match=r"expected a"):
        require_apart(commands()[name], {"out": tmp_path / "a_file/yet/here"})


def test_a_folder_and_a_file_beside_it_are_two_outputs(tmp_path: Path) -> None:
    require_apart(commands()["demo"], {"out": tmp_path / "none/demo"})
    (tmp_path / "none").mkdir()
    require_apart(commands()["offline"], {"tum": tmp_path / "none/a.tum", "json_file": tmp_path / "none/a.json"})


def test_a_file_in_no_folder_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a_file").touch()
    for place in (tmp_path / "nowhere/x", tmp_path / "a_file/x"):
        with pytest.raises(OSError, match=r"^--out: expected an existing folder .*, got none; create it or choose"):
            require_writable("--out", place)


def test_a_file_that_may_not_be_written_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "old").touch()
    for forbidden, file in ((tmp_path, tmp_path / "new"), (tmp_path / "old", tmp_path / "old")):
        monkeypatch.setattr("os.access", lambda path, mode, forbidden=forbidden: path != forbidden)  # as root may
        with pytest.raises(OSError, match=r"^--out: expected permission to write .*, got none; choose another"):
            require_writable("--out", file)


def test_a_folder_that_takes_no_file_whatever_its_permissions_say_is_refused_in_one_line(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("os.access", lambda *_: True)  # as root may
    with pytest.raises(
        OSError, match=r"^--out: expected a place that takes a file, got at /proc/x: .*; choose another$"
    ):
        require_writable("--out", Path("/proc/x"))


def test_a_file_that_refuses_to_be_written_is_refused_before_the_work(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> None:
        raise OSError(30, "Read-only file system")

    (tmp_path / "old.html").write_text("old")
    monkeypatch.setattr(Path, "open", refuse)
    with pytest.raises(OSError, match=r"got at .*old\.html: Read-only file system; choose another"):
        require_writable("--out", tmp_path / "old.html")


def test_an_old_file_in_a_folder_that_takes_no_new_one_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "old").touch()
    monkeypatch.setattr("os.access", lambda path, mode: path != tmp_path)  # as root may
    with pytest.raises(OSError, match=r"^--out: expected permission to write .*old, got none"):
        require_writable("--out", tmp_path / "old")


def test_links_in_a_circle_are_refused_in_one_line(tmp_path: Path) -> None:
    (tmp_path / "circle").symlink_to("circle")
    with pytest.raises(OSError, match=r"^--out: expected a place .*, got at .*circle: Too many levels of symbolic"):
        require_writable("--out", tmp_path / "circle")


def test_the_times_of_a_graph_are_an_output_too(tmp_path: Path) -> None:
    recording = tum_folder(tmp_path / "rec")
    graph, times = tmp_path / "map.g2o", tmp_path / "map.g2o.times.csv"
    with pytest.raises(ValueError, match="expected a file of its own, got that of"):
        run("offline", recording, "--g2o", graph, "--tum", times)
    times.mkdir()
    with pytest.raises(OSError, match=r"--g2o: expected a file, got the folder .*times"):
        run("offline", recording, "--g2o", graph)
