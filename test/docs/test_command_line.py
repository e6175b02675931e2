# SPDX-License-Identifier: Apache-2.0
"""The page of the command line has what `--help` has."""

from __future__ import annotations

import re
from pathlib import Path

from click.testing import CliRunner

from docs.command_line import OF_ALL, PAGE, page_text, reference
from objreg_tools.cli import SUMMARIES, group


def test_the_page_is_as_the_commands_are() -> None:
    page = PAGE.read_text(encoding="utf-8")
    assert page == page_text(page), "make it anew: python -m docs.command_line"


def test_every_option_that_help_shows_is_on_the_page() -> None:
    for name in SUMMARIES:
        section = reference().partition(f"### objreg {name}\n")[2].partition("\n### ")[0]
        shown = CliRunner().invoke(group, [name, "--help"]).output.partition("Options:")[2]
        options = set(re.findall(r"^  (?:-\w, )?(--[\w-]+)", shown, re.MULTILINE)) - {"--help"}
        assert options - {f"--{name}" for name in OF_ALL} == set(
            re.findall(r"^\| `(?:-\w, )?(--[\w-]+)", section, re.MULTILINE)
        ), name


def test_only_what_is_between_the_marks_is_made(tmp_path: Path) -> None:
    page = "mine\n<!-- made by docs/command_line.py -->\nold\n<!-- end of what was made -->\nmine too\n"
    made = page_text(page)
    assert made.startswith("mine\n") and made.endswith("\nmine too\n") and "\nold\n" not in made
