# SPDX-License-Identifier: Apache-2.0
"""`objreg where`: where the objects of a label are, by a store."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

import click
import numpy as np

from objreg_ros.whole_file import write_whole
from objreg_tools.cli import NOTHING
from objreg_tools.cli.commands.inspect import columns
from objreg_tools.cli.paths import STANDARD_OUTPUT, InputPath, OutputPath
from objreg_tools.report.exports.landmark_places import LandmarkPlace, as_geojson, landmark_places
from objreg_tools.report.exports.map_folder import level_of
from objreg_tools.report.exports.placed_keyframes import placed_in_store

HEAD = ("id", "label", "x", "y", "z", "±", "extent", "seen", "last seen")


@click.command()
@click.argument("store", type=InputPath(path_type=Path))
@click.argument("label", required=False, default="")
@click.option(
    "--from",
    "start",
    type=(float, float, float),
    metavar="X Y Z",
    help="A place on the map, m: the nearest come first. Else those that were seen last.",
)
@click.option(
    "--json",
    "json_file",
    type=OutputPath(dir_okay=False, allow_dash=True, path_type=Path),
    help="Write them here as landmarks.json has them, in this order; - is standard output, without the table.",
)
def command(store: Path, label: str, start: tuple[float, float, float] | None, json_file: Path | None) -> int:
    """Show where the objects of LABEL are on the corrected map of STORE, or all objects; STORE is not changed.

    Metres in the frame of `objreg export --map`, whose z is up. ± is the standard deviation of one sighting. The map is
    the largest part of the store that constraints tie together. Names the labels that there are, and ends with 3, where
    none is of LABEL.
    """
    placed = placed_in_store(store, lambda line: click.echo(f"! {line}", err=True))
    level = level_of(placed)
    T_level_map = np.eye(4) if level is None else level
    places = landmark_places(placed, T_level_map)
    found = in_order([place for place in places if is_called(place, label)], start)
    if json_file is not None:
        text = json.dumps(as_geojson(found, T_level_map), indent=1)
        if json_file == STANDARD_OUTPUT:
            click.echo(text)
        else:
            write_whole(json_file, text + "\n")
    if not found:
        click.echo(f"no {label or 'object'} on the map; there are: {labels_of(places)}", err=True)
        return NOTHING
    if json_file != STANDARD_OUTPUT:
        click.echo(columns(HEAD, [row_of(place) for place in found]))
    return 0


def is_called(place: LandmarkPlace, label: str) -> bool:
    """Whether a landmark has this label, in small letters or capitals; every one where none is asked for."""
    return not label or place.label.casefold() == label.casefold()


def in_order(places: Sequence[LandmarkPlace], start: tuple[float, float, float] | None) -> list[LandmarkPlace]:
    """The nearest to a place first, or those that were seen last where it is None."""
    if start is None:
        return sorted(places, key=lambda place: (-place.last_seen_ns, place.landmark))
    return sorted(places, key=lambda place: (float(np.linalg.norm(place.xyz - start)), place.landmark))


def row_of(place: LandmarkPlace) -> list[str]:
    """A row of the table."""
    last = datetime.fromtimestamp(place.last_seen_ns * 1e-9, UTC)
    return [
        str(place.landmark),
        place.label,
        *(f"{value:.2f}" for value in place.xyz.tolist()),
        f"{place.sigma:.2f}",
        f"{place.extent:.2f}",
        str(place.sightings),
        f"{last:%Y-%m-%d %H:%M:%S}",
    ]


def labels_of(places: Sequence[LandmarkPlace]) -> str:
    """The labels that there are with their counts, most first."""
    counts = Counter(place.label for place in places)
    return (
        ", ".join(f"{name} ({count})" for name, count in sorted(counts.items(), key=lambda item: (-item[1], item[0])))
        or "none"
    )
