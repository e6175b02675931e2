# SPDX-License-Identifier: Apache-2.0
"""Writes the reference of the commands into docs/command-line.md.

python -m docs.command_line
"""

from __future__ import annotations

import inspect
from collections.abc import Iterator
from pathlib import Path

import click

from objreg_tools.cli import NAME, SUMMARIES, group

PAGE = Path(__file__).parent / "command-line.md"
BEGIN, END = "<!-- made by docs/command_line.py -->", "<!-- end of what was made -->"
OF_ALL = ("quiet", "verbose")  # which the page describes once


def page_text(page: str) -> str:
    """The page with the reference made anew."""
    before, _, rest = page.partition(BEGIN)
    return f"{before}{BEGIN}\n\n{reference()}\n{END}{rest.partition(END)[2]}"


def reference() -> str:
    """Each command with its words and options, in Markdown."""
    context = click.Context(group, info_name=NAME)
    return "\n".join(line for name in SUMMARIES for line in _section(context, name))


def _section(context: click.Context, name: str) -> Iterator[str]:
    command = group.get_command(context, name)
    if command is None:
        raise ValueError(f"{name}: expected a command, got none of this name")
    arguments = [_value(p) for p in command.params if isinstance(p, click.Argument)]
    yield from (f"### {NAME} {name}", "", "```", " ".join([NAME, name, "[OPTIONS]", *arguments]), "```", "")
    yield from (inspect.cleandoc(command.help or ""), "")
    options = [p for p in command.params if isinstance(p, click.Option) and p.name not in OF_ALL]
    if options:
        yield from ("| option | default | |", "| --- | --- | --- |")
        yield from (_row(option) for option in options)
        yield ""


def _value(parameter: click.Parameter) -> str:
    """What stands for a value, as versions of click agree on it."""
    if parameter.metavar:
        return parameter.metavar
    if isinstance(parameter, click.Argument):
        name = f"{parameter.name or ''}{'…' if parameter.nargs != 1 else ''}".upper()
        return name if parameter.required else f"[{name}]"
    is_choice = isinstance(parameter.type, click.Choice)
    return "|".join(parameter.type.choices) if is_choice else parameter.type.name.split()[0].upper()


def _row(option: click.Option) -> str:
    value = "" if option.is_flag else f" {_value(option)}"
    default = str(option.default) if option.show_default else ""
    cells = [f"`{', '.join(option.opts)}{value}`", f"`{default}`" if default else "", option.help or ""]
    return f"| {' | '.join(cell.replace('|', '&#124;' if '`' not in cell else chr(92) + '|') for cell in cells)} |"


if __name__ == "__main__":
    PAGE.write_text(page_text(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
