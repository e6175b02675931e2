# SPDX-License-Identifier: Apache-2.0
"""The fit of the weights of evidence, on readings whose likelihood is known."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from objreg_ros.data.checked import Array
from objreg_ros.registration.gate.kinds import KINDS
from training import likelihood
from training.evidence import Plan, Rows, plans
from training.likelihood import accepted, balanced, begun_summary, fit, log_odds, main, reliability, steps_of, written

COUNT = 4000
CORRELATION = list(KINDS).index("correlation")
UNKNOWN = list(KINDS).index("silhouettes")


def drawn_rows(seed: int = 0, right_share: float = 0.5, sensor: str = "kinect_v1") -> Rows:
    """Poses that grey alone distinguishes: right ones correlate by 0.5, false ones by 0.2, with a deviation of 0.1."""
    rng = np.random.default_rng(seed)
    right = rng.random(COUNT) < right_share
    readings = np.full((COUNT, len(KINDS)), np.nan)
    readings[:, CORRELATION] = rng.normal(np.where(right, 0.5, 0.2), 0.1)
    error = np.where(right[:, None], (1.0, 2.0), (20.0, 50.0))
    each = np.arange(COUNT)
    return Rows(readings, error, np.zeros(COUNT, bool), each, 0 * each, np.full(COUNT, sensor))


def true_log_odds(correlation: Array) -> Array:
    """Of two normal distributions with one deviation."""
    return np.asarray(((correlation - 0.2) ** 2 - (correlation - 0.5) ** 2) / (2 * 0.1**2) / np.log(10.0))


def test_the_odds_are_those_of_the_distributions_that_made_the_readings() -> None:
    rows = drawn_rows()
    within = np.abs(rows.readings[:, CORRELATION] - 0.35) < 0.1
    found = log_odds(fit(rows), rows.readings)[within]
    assert np.abs(found - true_log_odds(rows.readings[within, CORRELATION])).max() < 0.4


def test_right_and_false_poses_count_as_much_however_many_there_are() -> None:
    few = fit(drawn_rows(right_share=0.1))
    (middle,) = log_odds(few, np.where(np.arange(len(KINDS)) == CORRELATION, 0.35, np.nan)[None])
    assert abs(middle) < 0.25
    assert balanced(np.array([True, False, False, False])) == pytest.approx([0.5, 1 / 6, 1 / 6, 1 / 6])


def test_a_weight_never_falls_where_evidence_gets_better_though_the_rows_say_so() -> None:
    rows = drawn_rows()
    rows.readings[:, CORRELATION] = 0.7 - rows.readings[:, CORRELATION]
    assert np.ptp(fit(rows).weights["correlation"]) < 0.01


def test_what_no_row_has_weighs_nothing_and_what_some_lack_has_a_weight() -> None:
    rows = drawn_rows()
    right, _ = begun_summary(rows)
    rows.readings[:, UNKNOWN] = np.where(right | (np.arange(COUNT) % 2 == 0), 0.3, np.nan)
    found = fit(rows)
    assert found.unknown["silhouettes"] < -0.5 and found.unknown["matched"] == 0.0
    assert np.ptp(fit(drawn_rows()).weights["silhouettes"]) == 0.0


def test_steps_are_how_far_a_reading_is_through_each_segment() -> None:
    readings = np.full((2, len(KINDS)), np.nan)
    readings[0, CORRELATION] = 0.25
    steps, names = steps_of(readings)
    own = [k for k, name in enumerate(names) if name == ("correlation", "rise")]
    assert steps[0, own] == pytest.approx([1.0, 1.0, 0.5, 0.0, 0.0, 0.0])
    assert steps[1, own] == pytest.approx(np.zeros(6)) and steps[1, names.index(("correlation", "unknown"))] == 1.0


def test_of_each_pair_the_first_is_accepted_that_is_likely_and_breaks_no_rule() -> None:
    nothing = np.zeros((5, len(KINDS)))
    pair, rank = np.array([0, 0, 1, 1, 2]), np.array([1, 0, 0, 1, 0])
    rows = Rows(nothing, np.zeros((5, 2)), np.array([0, 0, 1, 0, 0], bool), pair, rank, np.full(5, "kinect_v1"))
    taken = accepted(rows, np.array([3.0, 2.5, 9.0, 2.0, 1.0]), 100.0)
    assert taken.tolist() == [False, True, False, True, False]


def test_the_false_ones_that_the_odds_foretell_are_those_that_come() -> None:
    found, unseen = fit(drawn_rows(1)), drawn_rows(2)
    for line in reliability(unseen, log_odds(found, unseen.readings))[:3]:
        assert line["false"] == pytest.approx(line["predicted"], abs=3.0 + 0.5 * line["predicted"])


def test_what_is_written_is_what_was_fitted() -> None:
    found, names = fit(drawn_rows()), {}
    exec(written(found, 7, ["loop_1_kinect_v1_plain", "moved_2_azure_kinect_rig"]), names)
    assert (names["PRIOR"], names["WEIGHTS"], names["UNKNOWN"]) == (found.prior, found.weights, found.unknown)
    assert "7 pairs of keyframes in 2 simulated recordings" in names["__doc__"]


def test_fit_says_what_each_sensor_loses_by_being_left_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for seed, sensor in enumerate(("kinect_v1", "realsense_d435")):
        drawn_rows(seed, sensor=sensor).save(tmp_path / f"{sensor}.npz")
    monkeypatch.setattr(likelihood, "WRITTEN", tmp_path / "weights.py")
    done = CliRunner().invoke(main, ["fit", str(tmp_path), "--write", "--json", str(tmp_path / "fit.json")])
    assert done.exit_code == 0, done.output
    assert "realsense_d435: right poses accepted with it 0." in done.output
    assert (tmp_path / "weights.py").read_text().startswith("# SPDX") and (tmp_path / "fit.json").exists()


def test_check_judges_by_the_weights_of_the_package_and_says_what_is_missing(tmp_path: Path) -> None:
    drawn_rows().save(tmp_path / "a.npz")
    done = CliRunner().invoke(main, ["check", str(tmp_path)])
    assert done.exit_code == 0 and f"{COUNT} pairs by the weights of the package" in done.output
    (tmp_path / "none").mkdir()
    done = CliRunner().invoke(main, ["check", str(tmp_path / "none")])
    assert done.exit_code == 1 and "expected files of `gather`, got none" in done.output


def test_fresh_gathers_what_is_not_there_and_judges_only_what_it_was_asked_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    one, other = plans(40)[::18]
    drawn_rows(1).save(tmp_path / f"{one.name}.npz")
    drawn_rows(3).save(tmp_path / "of_another_seed.npz")
    gathered: list[Plan] = []

    def into(folder: Path, wanted: list[Plan], processes: int) -> None:
        assert folder == tmp_path and processes == 2
        gathered.extend(plan for plan in wanted if not (folder / f"{plan.name}.npz").exists())
        drawn_rows(2).save(folder / f"{other.name}.npz")

    monkeypatch.setattr(likelihood, "gather_into", into)
    done = CliRunner().invoke(main, ["fresh", "--first-seed", "40", "--every", "18", "--keep", str(tmp_path)])
    assert done.exit_code == 0 and f"{2 * COUNT} pairs by the weights of the package" in done.output
    assert gathered == [other]
