# SPDX-License-Identifier: Apache-2.0
"""What `objreg doctor` says of what was looked at."""

from __future__ import annotations

import json

import pytest
from click.testing import CliRunner, Result

from objreg_tools.cli import group
from objreg_tools.cli.checks import Check
from objreg_tools.cli.commands import doctor

GOOD = Check("packages", "numpy", "2.0")
ADVICE = Check("models", "of COCO", "none", "objreg fetch-model")
PROBLEM = Check("libraries", "libGL.so.1", "absent", "sudo apt-get install libgl1", stops=True)


def examined(monkeypatch: pytest.MonkeyPatch, checks: list[Check], *words: str) -> Result:
    monkeypatch.setattr(doctor, "all_checks", lambda: iter(checks))
    return CliRunner().invoke(group, ["doctor", *words], standalone_mode=False)


def test_where_nothing_stops_a_run_it_ends_with_0_and_advice(monkeypatch: pytest.MonkeyPatch) -> None:
    result = examined(monkeypatch, [GOOD, ADVICE])
    assert result.return_value == 0 and result.output.splitlines() == [
        "packages",
        "  numpy    2.0",
        "models",
        "- of COCO  none",
        "           -> objreg fetch-model",
        "A run can work here.",
    ]


def test_what_stops_a_run_is_said_again_at_the_end_and_it_ends_with_1(monkeypatch: pytest.MonkeyPatch) -> None:
    result = examined(monkeypatch, [GOOD, PROBLEM])
    assert result.return_value == 1 and "! libGL.so.1  absent" in result.output
    assert result.output.splitlines()[-2:] == [
        "No run can work here before this is mended (1):",
        "libGL.so.1: sudo apt-get install libgl1",
    ]


def test_quiet_is_the_verdict_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    assert examined(monkeypatch, [GOOD, ADVICE], "-q").output == "A run can work here.\n"


@pytest.mark.parametrize("checks", [[GOOD, ADVICE], [GOOD, PROBLEM]])
def test_the_json_says_the_same(monkeypatch: pytest.MonkeyPatch, checks: list[Check]) -> None:
    result = examined(monkeypatch, checks, "--json")
    report = json.loads(result.output)
    assert report["can_run"] is (PROBLEM not in checks) and result.return_value == int(PROBLEM in checks)
    assert report["checks"][1]["todo"] == checks[1].todo


def test_this_very_machine_is_examined_without_a_traceback() -> None:
    result = CliRunner().invoke(group, ["doctor"], standalone_mode=False)
    assert result.exception is None and {"system", "machine"} <= set(result.output.splitlines())
