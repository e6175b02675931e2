# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import json
from pathlib import Path

import click
import pytest
from click.testing import CliRunner

from objreg_ros.data.closures import Reason, Rejected
from objreg_ros.plausibility.finding import Finding
from objreg_tools.cli import NOTHING
from objreg_tools.cli.run_output import (
    closing_lines,
    exit_code,
    json_to,
    notify,
    print_memory,
    print_next,
    print_reasons,
)
from objreg_tools.cli.verbosity import received_by

FINDING = Finding("nothing is seen", "it is dark", "put on the light", "no-detections")


def test_a_finding_is_a_block_and_a_remark_a_line(capsys: pytest.CaptureFixture[str]) -> None:
    notify([FINDING, Finding("no odometry")])
    assert capsys.readouterr().out.splitlines() == [
        "! nothing is seen", "    likely: it is dark", "    next: put on the light",
        "    more: docs/troubleshooting.md#no-detections", "! no odometry",
    ]  # fmt: skip


def memory(store: str, keyframes: int, place: dict[str, int] | None) -> dict[str, object]:
    counts = {"sessions": 1, "keyframes": keyframes, "forgotten": 0}
    return {"store": store, "stored": {"before": counts, "after": counts}, "relocalised": place, "whereabouts": "why"}


def test_a_store_and_the_place_in_its_map_are_lines_and_without_them_there_is_none(
    capsys: pytest.CaptureFixture[str],
) -> None:
    print_memory(memory("/a.db", 7, {"session": 0, "first_ns": 5}))
    print_memory(memory("/a.db", 7, None))
    held = "  store /a.db: 1 session, 7 keyframes; now 1 session, 7 keyframes"
    assert capsys.readouterr().out.splitlines() == [
        held, "  relocalised in the map of session 0 from the frame of 5 ns on; in the end: why",
        held, "  not relocalised: why",
    ]  # fmt: skip
    print_memory(memory("", 0, None))
    assert capsys.readouterr().out == ""


def test_the_next_command_may_be_typed_as_it_stands(capsys: pytest.CaptureFixture[str]) -> None:
    print_next("objreg", "inspect", "my bag")
    assert capsys.readouterr().out == "next: objreg inspect 'my bag'\n"


def test_a_run_without_frames_has_an_exit_code_of_its_own() -> None:
    assert exit_code({"frames": 0}) == NOTHING == 3 and exit_code({"frames": 1}) == 0


def test_the_last_lines_say_whether_it_worked_where_to_look_and_what_to_do() -> None:
    run = {"frames": 9, "constraints": [], "detections": 0}
    failed = list(closing_lines(run, [FINDING], Path("out"), own=True))
    assert (
        failed[0] == "With every frame: No loop was closed: nothing is seen."
        and failed[-1] == "Next: put on the light."
    )
    assert "out/report.html" in failed[1] and "out/logs" in failed[1]
    assert "YOUR_RECORDING" in list(closing_lines({**run, "constraints": [{}]}, [], Path("out"), own=False))[-1]


def test_json_goes_into_its_file_or_nowhere(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for file in (tmp_path / "run.json", None):
        with json_to(file) as write:
            click.echo("said")
            write({"frames": 1})
    assert json.loads((tmp_path / "run.json").read_text()) == {"frames": 1}
    assert capsys.readouterr().out == "said\nsaid\n"


def test_json_for_standard_output_is_all_that_goes_there(capsys: pytest.CaptureFixture[str]) -> None:
    with json_to(Path("-")) as write:
        click.echo("said")
        write({"frames": 1})
    received = capsys.readouterr()
    assert json.loads(received.out) == {"frames": 1} and received.err == "said\n"


def test_reasons_are_given_to_who_asks_for_them() -> None:
    refused = Rejected(reason=Reason.NO_CANDIDATE, from_ns=2, to_ns=1, detail="none is near")
    command = received_by(click.Command("run", callback=lambda: print_reasons([refused])))
    assert CliRunner().invoke(command, []).output == ""
    assert CliRunner().invoke(command, ["-v"]).output == "  2 to 1 ns: no_candidate: none is near\n"
