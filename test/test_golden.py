# SPDX-License-Identifier: Apache-2.0
"""Six short recordings give what they gave when their golden files were recorded.

Compared as another processor allows; `python test/golden/record.py --check` compares to the last digit.
"""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from golden import files, record, runs
from golden.comparison import differences

from objreg_ros.data.images import ColourImage
from objreg_ros.geometry import pose, rotation_from_vector

LEAST = 5  # constraints, and refusals for which something was registered, without which a recording shows little
RECORDED_WITH = 5  # OpenCV
FEW = 3  # refusals of a pose, in the shortest recording


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name, of in runs.SOURCES.items() if isinstance(of, runs.Simulated)])
def test_a_simulated_recording_gives_what_it_gave(name: str, tmp_path: Path) -> None:
    require_the_same(name, runs.simulated(runs.SOURCES[name], tmp_path / name))


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name, of in runs.SOURCES.items() if isinstance(of, runs.Real)])
def test_a_real_recording_gives_what_it_gave(name: str, shared: Path) -> None:
    require_the_same(name, shared / "data" / runs.SOURCES[name].folder)


def require_the_same(name: str, path: Path) -> None:
    if int(cv2.__version__.partition(".")[0]) < RECORDED_WITH:
        pytest.skip(f"recorded with OpenCV {RECORDED_WITH}, got {cv2.__version__}: its resampling has other digits")
    golden = files.read(name)
    now = runs.results(runs.run(path, runs.Stored(golden.detections), runs.SOURCES[name].frames))
    found = differences(golden.results, now, real=isinstance(runs.SOURCES[name], runs.Real))
    assert not found, f"{name} gives something else; test/golden/record.py records anew:\n" + "\n".join(found)


@pytest.mark.parametrize("name", runs.SOURCES)
def test_a_golden_file_holds_several_constraints_and_refusals_with_their_numbers(name: str) -> None:
    results = files.read(name).results
    assert results["frames"] == runs.SOURCES[name].frames and not results["dropped"]
    assert len(results["constraints"]) >= LEAST
    assert all(len(row["evidence"]) > LEAST for row in results["constraints"])
    assert len(results["refusals"]) >= FEW


def test_the_golden_files_hold_refusals_with_poses_and_numbers() -> None:
    refusals = [row for name in runs.SOURCES for row in files.read(name).results["refusals"]]
    reasons = [row["reason"] for row in refusals if row["T_from_to"] is not None and row["detail"] != ""]
    assert len(reasons) >= LEAST and len(set(reasons)) >= FEW


@pytest.mark.parametrize("name", runs.SOURCES)
def test_a_golden_file_is_as_it_would_be_written_anew(name: str) -> None:
    golden = files.read(name)
    assert files.text_of(golden) == files.path_of(name).read_text(encoding="utf-8")
    assert all(stamp_ns == of.stamp_ns for stamp_ns, of in golden.detections.items())


def test_stored_detections_are_those_of_the_picture_of_that_stamp() -> None:
    seen = files.read("loop").detections
    stamp_ns = next(stamp_ns for stamp_ns in seen if len(seen[stamp_ns]))
    picture = ColourImage(rgb=np.zeros((240, 320, 3), np.uint8), stamp_ns=stamp_ns)
    assert runs.Stored(seen).detect(picture) is seen[stamp_ns]


def test_a_picture_that_no_model_saw_is_refused_with_what_to_do() -> None:
    picture = ColourImage(rgb=np.zeros((240, 320, 3), np.uint8), stamp_ns=7)
    with pytest.raises(KeyError, match="at 7 ns, got none; record anew"):
        runs.Stored({}).detect(picture)


@pytest.fixture()
def results() -> dict[str, Any]:
    return files.read("loop").results


def changed(results: dict[str, Any], metres: float = 0.0, degrees: float = 0.0, scale: float = 1.0) -> dict[str, Any]:
    """The results with another pose and covariance of the first constraint."""
    other = copy.deepcopy(results)
    row = other["constraints"][0]
    push = pose(rotation_from_vector(np.array([np.radians(degrees), 0.0, 0.0])), np.zeros(3))
    T = np.array(row["T_from_to"]) @ push
    T[0, 3] += metres
    row["T_from_to"], row["covariance"] = T.tolist(), (scale * np.array(row["covariance"])).tolist()
    return other


def test_the_same_results_do_not_differ(results: dict[str, Any]) -> None:
    assert differences(results, copy.deepcopy(results)) == differences(results, results, exact=True) == []


@pytest.mark.parametrize("change", [{"metres": 9e-5}, {"degrees": 0.009}, {"scale": 1.009}])
def test_what_another_processor_may_change_differs_only_to_the_last_digit(
    results: dict[str, Any], change: dict[str, float]
) -> None:
    assert differences(results, changed(results, **change)) == []
    assert len(differences(results, changed(results, **change), exact=True)) == 1


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"metres": 1.1e-4}, "T_from_to: off by 0.0000° and 0.110 mm"),
        ({"degrees": 0.011}, "T_from_to: off by 0.0110° and 0.000 mm"),
        ({"scale": 1.011}, "covariance: off by 1.10 %"),
        ({"metres": float("nan")}, "nan mm"),
    ],
)
def test_a_pose_or_covariance_that_is_farther_off_differs(
    results: dict[str, Any], change: dict[str, float], said: str
) -> None:
    (line,) = differences(results, changed(results, **change))
    assert said in line


def test_a_real_pose_may_be_off_within_its_own_deviation_and_no_farther(results: dict[str, Any]) -> None:
    variances = np.diag(np.array(results["constraints"][0]["covariance"]))
    metres, degrees = np.sqrt(variances[:3].sum()), np.degrees(np.sqrt(variances[3:].sum()))
    assert differences(results, changed(results, 0.9 * metres, 0.9 * degrees, 1.45), real=True) == []
    for change in ({"metres": 1.1 * metres}, {"degrees": 1.1 * degrees}, {"scale": 1.55}):
        assert len(differences(results, changed(results, **change), real=True)) == 1


def test_another_verdict_on_more_than_a_few_pairs_differs(results: dict[str, Any]) -> None:
    other = copy.deepcopy(results)
    for row in other["refusals"]:
        row["reason"] = "low_worth"
    lost = other["constraints"].pop()
    found = differences(results, other)
    assert f"{lost['from_ns']} to {lost['to_ns']} ns: accepted became untried" in found
    assert sum("became low_worth" in line for line in found) > 3


def test_two_pairs_that_are_no_longer_accepted_differ(results: dict[str, Any]) -> None:
    other = copy.deepcopy(results)
    del other["constraints"][-2:]
    assert len(differences(results, other)) == 2


def test_one_pair_in_twenty_may_have_another_verdict_on_another_processor(results: dict[str, Any]) -> None:
    other = copy.deepcopy(results)
    other["refusals"][-1]["reason"] = "low_worth"
    del other["constraints"][-1]
    assert differences(results, other) == [] and len(differences(results, other, exact=True)) == 2


def test_other_objects_of_a_constraint_differ(results: dict[str, Any]) -> None:
    other = copy.deepcopy(results)
    other["constraints"][0]["labels"] = ["spoon"]
    assert len(differences(results, other)) == 1


def test_evidence_and_details_differ_only_to_the_last_digit(results: dict[str, Any]) -> None:
    other = copy.deepcopy(results)
    name = next(iter(other["constraints"][0]["evidence"]))
    other["constraints"][0]["evidence"][name] += 1e-12
    other["refusals"][0]["detail"] += "."
    assert differences(results, other) == []
    found = differences(results, other, exact=True)
    assert len(found) == 2 and f"evidence: {name} " in found[0]


def test_the_order_of_verdicts_counts_to_the_last_digit(results: dict[str, Any]) -> None:
    other = copy.deepcopy(results)
    other["constraints"].reverse()
    assert differences(results, other) == []
    assert differences(results, other, exact=True) == ["the order of constraints or refusals is another"]


def test_recording_anew_refuses_a_name_that_there_is_not(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        record.main(["--check", "lop"])
    assert "expected one of redkitchen_a, loop" in capsys.readouterr().err


def test_recordings_that_are_absent_are_left_out(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert record.main(["--check", "redkitchen_a", "--shared", str(tmp_path)]) == 0
    assert capsys.readouterr().out == f"redkitchen_a: left out, no recordings at {tmp_path}\n"


def test_a_check_fails_where_a_digit_differs_and_writes_nothing(
    results: dict[str, Any], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    golden = files.read("loop")
    text = files.path_of("loop").read_text(encoding="utf-8")
    monkeypatch.setattr(record, "_recorded", lambda *_: files.Golden(golden.detections, changed(results, 1e-12)))
    assert record.main(["--check", "loop"]) == 1
    assert "T_from_to: off by" in capsys.readouterr().out
    assert files.path_of("loop").read_text(encoding="utf-8") == text


def test_what_is_recorded_anew_is_written_after_what_changed_was_printed(
    results: dict[str, Any], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    golden = files.read("loop")
    now = files.Golden(golden.detections, changed(results, 1e-3))
    (tmp_path / "loop.json").write_text(files.text_of(golden), encoding="utf-8")
    monkeypatch.setattr(files, "FOLDER", tmp_path)
    monkeypatch.setattr(record, "_recorded", lambda *_: now)
    assert record.main(["loop"]) == 0
    summary = f"loop: {len(results['constraints'])} constraints, {len(results['refusals'])} refusals, 2 differences"
    assert summary in capsys.readouterr().out
    assert files.read("loop").results == now.results
