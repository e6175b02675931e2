# SPDX-License-Identifier: Apache-2.0
"""Where the names of classes come from."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from objreg_ros.detector import labels
from objreg_ros.detector.labels import find_labels, read_labels


def test_a_first_line_of_question_marks_is_the_background(tmp_path: Path) -> None:
    path = tmp_path / "labels.txt"
    path.write_text("???\nperson\n???\ncar\n\n")
    assert read_labels(path) == ("person", "???", "car")


def test_windows_line_ends_and_a_byte_order_mark_are_no_part_of_a_name(tmp_path: Path) -> None:
    path = tmp_path / "labels.txt"
    path.write_bytes("\ufeffcap\r\nbowl\r\n".encode())
    assert read_labels(path) == ("cap", "bowl")


def test_a_named_file_wins_over_metadata_and_metadata_over_a_file_beside_the_model(tmp_path: Path) -> None:
    model, named = tmp_path / "m.onnx", tmp_path / "named.txt"
    named.write_text("named")
    (tmp_path / "labelmap.txt").write_text("map")
    metadata = {"objreg.labels": '["inside"]'}
    assert find_labels(model, named, metadata) == ("named",)
    assert find_labels(model, None, metadata) == ("inside",)
    assert find_labels(model, None, {}) == ("map",)
    (tmp_path / "m.txt").write_text("own")
    assert find_labels(model, None, {}) == ("own",)


def test_no_labels_at_all_are_refused_with_the_places_that_were_searched(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"expected objreg.labels or names .* got neither; name a file"):
        find_labels(tmp_path / "m.onnx", None, {})


@pytest.mark.parametrize("text", ["not json", "{}", "[]", "[1]", '[""]', "[" * 100_000, "9" * 5000])
def test_labels_that_are_no_list_of_names_are_refused(text: str, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="expected a JSON list of names"):
        find_labels(tmp_path / "m.onnx", None, {"objreg.labels": text})


@pytest.mark.parametrize("content", [b"", b"a\n\nb\n", b"\xff\xfe\x00"])
def test_a_file_that_is_no_list_of_names_is_refused(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "labels.txt"
    path.write_bytes(content)
    with pytest.raises(ValueError, match="one label a line"):
        read_labels(path)
    with pytest.raises(ValueError, match="one label a line"):
        read_labels(tmp_path / "absent.txt")


def test_what_is_no_file_of_labels_is_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.txt")
    for path in (tmp_path / "pipe.txt", Path("/dev/zero"), tmp_path):
        with pytest.raises(ValueError, match=r"expected a file of one label a line, .* got a folder, pipe or device"):
            read_labels(path)


def test_a_file_that_is_too_long_for_labels_is_refused_unread(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "labels.txt").write_text("person")
    monkeypatch.setattr(labels, "FILE_BYTES", 5)
    with pytest.raises(ValueError, match="one label a line, at most 5 bytes, got 6 bytes"):
        read_labels(tmp_path / "labels.txt")


@pytest.mark.parametrize("text", ["{0: 'cup', 1: 'tea pot'}", "{1: 'tea pot', 0: 'cup'}", "['cup', 'tea pot']"])
def test_names_that_ultralytics_wrote_are_read(text: str, tmp_path: Path) -> None:
    assert find_labels(tmp_path / "m.onnx", None, {"names": text}) == ("cup", "tea pot")
    (tmp_path / "mine.txt").write_text("named")
    assert find_labels(tmp_path / "m.onnx", tmp_path / "mine.txt", {"names": text}) == ("named",)


@pytest.mark.parametrize(
    "text",
    ["", "{}", "[]", "{1: 'a'}", "{0: 1}", "{0: ' '}", "__import__('os')", "(" * 9000, "-" * 90_000 + "1", "{[]: 1}",
     "['" + "a" * 300_000 + "']", "5"],
)  # fmt: skip
def test_names_of_another_kind_are_refused(text: str, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="expected a dict of class numbers from 0 and names") as refusal:
        find_labels(tmp_path / "m.onnx", None, {"names": text})
    assert len(str(refusal.value)) < 400


@pytest.mark.parametrize(
    "text",
    ["names:\n  0: cup\n  1: tea pot\n", "nc: 2\nnames: [cup, tea pot]\n", "# two\nnames:\n- cup\n- tea pot\n",
     "names: {1: tea pot, 0: cup}", "- cup\n- tea pot\n", "0: cup\n1: tea pot\n", '["cup", "tea pot"]',
     "path: ../coco\ntrain: images\n\nnames:\n  0: cup\n  1: tea pot\n\ndownload: |\n  import os\n"],
)  # fmt: skip
def test_a_file_of_labels_may_be_yaml(text: str, tmp_path: Path) -> None:
    (tmp_path / "m.txt").write_text(text)
    assert find_labels(tmp_path / "m.onnx", None, {}) == ("cup", "tea pot")


def test_what_yaml_takes_for_truth_is_a_name_like_any_other(tmp_path: Path) -> None:
    (tmp_path / "m.txt").write_text("names: [yes, 7, null]")
    assert read_labels(tmp_path / "m.txt") == ("yes", "7", "null")


@pytest.mark.parametrize(
    "text",
    ["names: 3", "names: {1: cup}", "names: {a: cup}", "names: [[a]]", "names: [", "{nc: 2}", "[" * 5000, "names:"],
)
def test_yaml_without_names_is_refused_in_one_line(text: str, tmp_path: Path) -> None:
    (tmp_path / "m.txt").write_text(text)
    with pytest.raises(ValueError, match=r"m\.txt: expected one label a line, or names: ") as refusal:
        read_labels(tmp_path / "m.txt")
    assert "\n" not in str(refusal.value)


def test_numbers_of_classes_may_be_text(tmp_path: Path) -> None:
    assert find_labels(tmp_path / "m.onnx", None, {"names": '{"0": "cup", "1": "chair"}'}) == ("cup", "chair")


@pytest.mark.parametrize("names", ["None", "{1: 'a', 2: 'b'}", "{0: 'a'}", "['a', 'b', 'c']"])
def test_a_file_beside_stands_in_for_metadata_that_do_not_fit(names: str, tmp_path: Path) -> None:
    (tmp_path / "m.txt").write_text("cup\nchair\n")

    def two(labels: tuple[str, ...]) -> None:
        if len(labels) != 2:
            raise ValueError(f"expected 2 labels, got {len(labels)}")

    assert find_labels(tmp_path / "m.onnx", None, {"names": names}, two) == ("cup", "chair")
    (tmp_path / "m.txt").unlink()
    with pytest.raises(ValueError, match=r"expected (2 labels, got|a dict .*--labels\), or put that file .*m\.txt)"):
        find_labels(tmp_path / "m.onnx", None, {"names": names}, two)


@pytest.mark.parametrize("end", [".txt", ".names", ".yaml", ".yml"])
def test_the_file_beside_a_model_may_end_as_tools_end_it(end: str, tmp_path: Path) -> None:
    (tmp_path / f"m{end}").write_text("names: [cup]")
    assert find_labels(tmp_path / "m.onnx", None, {}) == ("cup",)
