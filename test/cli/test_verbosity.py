# SPDX-License-Identifier: Apache-2.0
"""What a command prints with -q, with -v, and with neither."""

from __future__ import annotations

import sys
from inspect import signature

import click
import pytest
from click.testing import CliRunner, Result

from objreg_tools.cli.verbosity import aside, is_quiet, is_verbose, received_by


def said(*words: str) -> Result:
    """What a command in a group says, both of which receive the options."""

    @click.group()
    def group() -> None:
        pass

    @group.command()
    def run() -> None:
        click.echo("a note", err=True)
        with aside():
            click.echo("a line")
        if is_verbose():
            click.echo("a reason")
        click.echo("the result")

    received_by(received_by(run))
    apart = {"mix_stderr": False} if "mix_stderr" in signature(CliRunner).parameters else {}  # before click 8.2
    return CliRunner(**apart).invoke(received_by(group), words)


def test_usually_all_but_the_reasons_is_printed() -> None:
    result = said("run")
    assert (result.stdout, result.stderr) == ("a line\nthe result\n", "a note\n")


@pytest.mark.parametrize("words", [("-q", "run"), ("run", "-q"), ("--quiet", "run"), ("-q", "run", "--quiet")])
def test_quiet_is_the_result_alone_wherever_it_is_said(words: tuple[str, ...]) -> None:
    before = sys.stderr
    result = said(*words)
    assert (result.stdout, result.stderr, result.exit_code) == ("the result\n", "", 0)
    assert sys.stderr is before


@pytest.mark.parametrize("words", [("-v", "run"), ("run", "--verbose")])
def test_verbose_has_the_reasons_too(words: tuple[str, ...]) -> None:
    assert said(*words).stdout == "a line\na reason\nthe result\n"


@pytest.mark.parametrize("words", [("-q", "-v", "run"), ("-q", "run", "-v"), ("run", "-v", "-q")])
def test_both_are_refused(words: tuple[str, ...]) -> None:
    result = said(*words)
    assert result.exit_code == 2 and "expected -q or -v, got both" in result.stderr


def test_outside_of_a_command_line_nothing_is_hushed(capsys: pytest.CaptureFixture[str]) -> None:
    with aside():
        click.echo("received")
    assert capsys.readouterr().out == "received\n" and not is_quiet() and not is_verbose()


@pytest.mark.parametrize("words", [("run", "-q", "--nothing"), ("-q", "fly")])
def test_a_command_line_that_is_none_is_reported_although_it_asks_for_quiet(words: tuple[str, ...]) -> None:
    assert "No such" in said(*words).stderr
