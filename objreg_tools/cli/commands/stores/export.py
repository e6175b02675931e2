# SPDX-License-Identifier: Apache-2.0
"""`objreg export`: the objects of a store as PLY and JSON."""

from __future__ import annotations

from pathlib import Path

import click
from tqdm import tqdm

from objreg_tools.cli.paths import InputPath, OutputPath
from objreg_tools.report.exports.export import export


@click.command()
@click.argument("store", type=InputPath(path_type=Path))
@click.argument("folder", type=OutputPath(file_okay=False, path_type=Path))
def command(store: Path, folder: Path) -> None:
    """Write the objects, contexts and closures of STORE into FOLDER, new or empty, as PLY clouds and one map.json.

    Clouds are in metres as doubles, in the frame of the session (of its odometry, or of its first camera). STORE is not
    changed. Damaged keyframes are left out and listed.
    """
    written, damaged = 0, list[str]()
    for _ in tqdm(export(store, folder, damaged.append), desc="write", unit=" files", disable=None):
        written += 1
    for line in damaged:
        click.echo(f"! {line}", err=True)
    click.echo(f"wrote {written} files into {folder}")
