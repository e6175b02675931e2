# SPDX-License-Identifier: Apache-2.0
"""`objreg params`: every parameter, and the two files that are made from them."""

from __future__ import annotations

import json
import textwrap
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click

from objreg_ros.bridge.node.params import NodeBaseParams
from objreg_ros.params import Declaration, Params
from objreg_ros.whole_file import write_whole
from objreg_tools.cli.settings import KEY, NODES

YAML_FILE, TABLE_FILE = "config/objreg.yaml", "docs/parameters.md"
WIDTH = 120
IN_ANY_NAMESPACE = "/**/"  # before a node's name, which alone is to rcl that of the node in no namespace


@click.command()
@click.option("--table", "form", flag_value="table", default="table", help=f"The tables of {TABLE_FILE} (the default).")
@click.option("--yaml", "form", flag_value="yaml", help="A ROS 2 parameter file with every default.")
@click.option("--write", is_flag=True, help=f"Write {YAML_FILE} and {TABLE_FILE} of this checkout again.")
def command(form: str, write: bool) -> None:
    """Show every parameter of every node with its default, range and meaning."""
    if write:
        for file in write_files(Path(__file__).resolve().parents[3]):
            click.echo(f"wrote {file}")
    else:
        click.echo(yaml_text() if form == "yaml" else table_text(), nl=False)


def write_files(repository: Path) -> list[Path]:
    """Write the files that are made from the parameters; FileNotFoundError outside of a checkout."""
    if not (repository / "package.xml").is_file():
        raise FileNotFoundError(f"{repository}: expected a checkout of the repository; --yaml and --table only print")
    files = {repository / YAML_FILE: yaml_text(), repository / TABLE_FILE: page_text()}
    for file, text in files.items():
        write_whole(file, text)
    return list(files)


def page_text() -> str:
    """The page of all parameters, in Markdown."""
    return f"# Parameters\n\nMade by `objreg params --write` from the code, as `{YAML_FILE}` is.\n\n{table_text()}"


def yaml_text() -> str:
    """A ROS 2 parameter file with every node's defaults, each with its meaning."""
    lines = [
        "# Made by `objreg params --write` from the code: change defaults there, and copies of this file here.",
        "# /**/ before a node's name stands for any namespace, and for none.",
    ]
    for node, kinds in NODES.items():
        lines += ["", f"{IN_ANY_NAMESPACE}{node}:", f"  {KEY}:"]
        lines += [line for kind in kinds for declaration in kind.declarations() for line in _yaml_lines(declaration)]
    return "\n".join(lines) + "\n"


def _yaml_lines(declaration: Declaration) -> list[str]:
    remark = textwrap.wrap(_remark(declaration), WIDTH - 6)
    setting = f"{declaration.name}: {yaml_value(declaration.default)}"
    if declaration.default == ():  # a parameter file cannot hold an empty list
        setting = f"# {setting}"
    return [*(f"    # {line}" for line in remark), f"    {setting}"]


def _remark(declaration: Declaration) -> str:
    notes = [declaration.unit, declaration.range_text, "" if declaration.live else "read-only"]
    notes_text = ", ".join(note for note in notes if note)
    return f"{declaration.doc} ({notes_text})" if notes_text else declaration.doc


def yaml_value(value: Any) -> str:
    """A value as YAML that ROS reads back in the same type."""
    if isinstance(value, tuple):
        return f"[{', '.join(yaml_value(item) for item in value)}]"
    if isinstance(value, float):
        mantissa, e, exponent = repr(value).partition("e")
        return f"{mantissa if '.' in mantissa else mantissa + '.0'}{e}{exponent}"
    return json.dumps(value, ensure_ascii=False)


def table_text() -> str:
    """The parameters as Markdown tables, one a node; what every node has comes last."""
    own = {node: [kind for kind in kinds if kind is not NodeBaseParams] for node, kinds in NODES.items()}
    sections = [line for node, kinds in own.items() for line in _section(f"`{node}`", kinds)]
    return "\n".join([*sections, *_section("Every node", [NodeBaseParams])]) + "\n"


def _section(title: str, kinds: list[type[Params]]) -> Iterator[str]:
    yield from (
        f"## {title}",
        "",
        "| parameter | default | unit | range | live | |",
        "| --- | --- | --- | --- | --- | --- |",
    )
    for kind in kinds:
        yield from (_row(declaration) for declaration in kind.declarations())
    yield ""


def _row(declaration: Declaration) -> str:
    default = yaml_value(declaration.default)
    cells = [f"`{declaration.name}`", f"`{default}`", declaration.unit, declaration.range_text,
             "yes" if declaration.live else "", declaration.doc]  # fmt: skip
    return f"| {' | '.join(cell.replace('|', '/') for cell in cells)} |"
