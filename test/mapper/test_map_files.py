# SPDX-License-Identifier: Apache-2.0
"""What a save of a map may write over."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from objreg_mapper import saved
from objreg_mapper.formats.g2o import TIMES, graph_text, times_file, times_text
from objreg_mapper.map_files import graph_file, require_ours, write_graph
from objreg_mapper.params import MapperParams
from objreg_mapper.pose_graph import PoseGraph

THREE_POSES = [np.eye(4), np.eye(4), np.eye(4)]


def test_a_graph_and_a_map_that_we_wrote_are_ours(tmp_path: Path) -> None:
    text, arrays = tmp_path / "map.g2o", tmp_path / "map.npz"
    text.write_text(graph_text(THREE_POSES, []))
    saved.save(saved.packed(PoseGraph(MapperParams())), arrays)
    for path in (text, arrays, tmp_path / "none.g2o"):
        require_ours(path)
    assert graph_file(str(text)) == text


def test_a_graph_is_written_with_the_times_of_its_vertices_and_again(tmp_path: Path) -> None:
    path = graph_file(str(tmp_path / "map.g2o"))
    for count in (2, 3):
        write_graph(path, graph_text(THREE_POSES[:count], []), times_text([(5, 0)] * count))
        assert len(times_file(path).read_text().splitlines()) == 1 + count == 1 + len(path.read_text().splitlines())
    assert graph_file(str(path)) == path


def test_times_that_are_not_ours_are_kept_and_the_graph_is_not_written(tmp_path: Path) -> None:
    path = tmp_path / "map.g2o"
    times_file(path).write_text(f"{TIMES},mine\n")
    with pytest.raises(OSError, match="expected a map or none, got another file"):
        write_graph(path, graph_text(THREE_POSES, []), times_text([(5, 0)] * 3))
    with pytest.raises(ValueError, match=r"graph_path: .*map\.g2o\.times\.csv"):
        graph_file(str(path))
    assert not path.exists() and times_file(path).read_text() == f"{TIMES},mine\n"


def test_an_empty_file_is_written_over(tmp_path: Path) -> None:
    for name in ("map.g2o", "map.npz"):
        (tmp_path / name).touch()
        require_ours(tmp_path / name)


@pytest.mark.parametrize(
    ("name", "content"),
    [
        (".bashrc", b"export PATH"),
        ("map.g2o", b"VERTEX_SE3:QUAT 0 1 2 3 0 0 0 1\n"),  # of another program, with other digits
        ("map.g2o", b"PK\x03\x04"),
        ("map.npz", b"VERTEX_SE3:QUAT 0 0.000000000"),
        ("notes.txt", b"\x00" * 4096),
    ],
)
def test_a_file_of_another_kind_is_kept(name: str, content: bytes, tmp_path: Path) -> None:
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(OSError, match="expected a map or none, got another file"):
        require_ours(path)
    with pytest.raises(ValueError, match=f"graph_path: .*{name}"):
        graph_file(str(path))
    assert path.read_bytes() == content


def test_the_arrays_of_another_program_are_kept(tmp_path: Path) -> None:
    np.savez(tmp_path / "map.npz", weights=np.ones(3))
    with pytest.raises(OSError, match="got another file"):
        require_ours(tmp_path / "map.npz")


def test_a_pipe_is_refused_and_not_opened(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "map.g2o")
    with pytest.raises(ValueError, match="expected a plain file or none"):
        graph_file(str(tmp_path / "map.g2o"))


@pytest.mark.parametrize("path", ["nowhere/map.g2o", "~nobody_of_this_name/map.g2o"])
def test_a_folder_that_is_not_there_is_refused(path: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ValueError, match="graph_path: "):
        graph_file(path)
