# SPDX-License-Identifier: Apache-2.0
"""`objreg export`: the objects of a store as PLY and JSON, and its map."""

from __future__ import annotations

from pathlib import Path

import click
from tqdm import tqdm

from objreg_tools.cli import options
from objreg_tools.cli.paths import InputPath, OutputPath
from objreg_tools.report.exports.export import export
from objreg_tools.report.exports.occupancy_grid import GridParams


@click.command()
@click.argument("store", type=InputPath(path_type=Path))
@click.argument("folder", type=OutputPath(file_okay=False, path_type=Path))
@click.option(
    "--map",
    "with_map",
    is_flag=True,
    help="Write the corrected map too, of the largest part that constraints tie together: map.pgm with map.yaml, a "
    "grid as Nav2's map_server reads it, the cloud map.ply, and the objects with their covariances, landmarks.json.",
)
@options.of_grid
def command(store: Path, folder: Path, with_map: bool, cell: float, band: tuple[float, float]) -> None:
    """Write the objects, contexts and closures of STORE into FOLDER, new or empty, as PLY clouds and one map.json.

    Clouds are in metres as doubles, in the frame of the session (of its odometry, or of its first camera); those of
    --map are in one frame, whose z is up. STORE is not changed. Damaged keyframes are left out and listed.
    """
    written, notes = 0, list[str]()
    grid = GridParams(cell, *band)
    for _ in tqdm(
        export(store, folder, notes.append, grid if with_map else None), desc="write", unit=" files", disable=None
    ):
        written += 1
    for line in dict.fromkeys(notes):
        click.echo(f"! {line}", err=True)
    click.echo(f"wrote {written} files into {folder}")
