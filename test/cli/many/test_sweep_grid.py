# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import pytest

from objreg_tools.cli.many.sweep_grid import MOST, Grid, default_of

ODDS, SEED = "registrar.least_odds", "registrar.seed"
MANY = f"{SEED}={','.join(map(str, range(MOST)))}"


def test_every_combination_is_there_once_and_the_last_parameter_changes_first() -> None:
    grid = Grid.of([f"{ODDS}=20,75", "detector.threshold=0.3, 0.5", f"{SEED}=7"])
    assert [one.changes for one in grid.combinations] == [
        (f"{ODDS}={odds}", f"detector.threshold={threshold}") for odds in (20, 75) for threshold in (0.3, 0.5)
    ]
    assert grid.fixed == (f"{SEED}=7",) and len(grid) == 4 and grid.text == "4 (2 × 2)"
    assert grid.combinations[0].parsed == {ODDS: 20.0, "detector.threshold": 0.3}


def test_the_same_value_in_two_spellings_is_one() -> None:
    grid = Grid.of([f"{ODDS}=20,20.0,2e1,75", f"{ODDS}=75"])
    assert [one.parsed[ODDS] for one in grid.combinations] == [20.0, 75.0]


def test_the_folder_of_a_combination_depends_on_its_values_alone() -> None:
    one, other = Grid.of([f"{ODDS}=20,75", f"{SEED}=1,2"]), Grid.of([f"{SEED}=3,1", f"{ODDS}=9,20.0"])
    digests = [{combination.digest for combination in grid.combinations} for grid in (one, other)]
    assert len(digests[0]) == 4 and len(digests[0] & digests[1]) == 1


def test_a_list_keeps_its_commas_and_is_swept_by_being_given_again() -> None:
    groups = "registrar.label_groups"
    grid = Grid.of([f"{groups}=cup mouse,book tv", f"{groups}=cup bottle"])
    assert [one.parsed[groups] for one in grid.combinations] == [("cup mouse", "book tv"), ("cup bottle",)]


def test_a_camera_keeps_its_commas() -> None:
    grid = Grid.of(["segmenter.camera=525,525,319.5,239.5", f"{ODDS}=20,75"])
    assert grid.fixed == ("segmenter.camera=525,525,319.5,239.5",)


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ([], "expected several values"),
        ([f"{ODDS}=20"], "expected several values"),
        ([f"{ODDS}=20,many"], "least_odds"),
        ([f"{ODDS}=20,"], "least_odds"),
        ([f"{ODDS}=20,0.5"], "least_odds"),
        (["robot.speed=1,2"], "expected node.parameter=value"),
        (
            [f"{SEED}={','.join(map(str, range(MOST)))}", f"{ODDS}=20,75"],
            r"at most 256 combinations, got 512 \(256 × 2\)",
        ),
    ],
)
def test_what_cannot_be_swept_is_refused_before_anything_is_run(changes: list[str], why: str) -> None:
    with pytest.raises(ValueError, match=why):
        Grid.of(changes)


def test_defaults_are_those_that_the_parameters_declare() -> None:
    assert default_of(ODDS) == 75.0
    with pytest.raises(ValueError, match=r"registrar\.no_such"):
        default_of("registrar.no_such")
