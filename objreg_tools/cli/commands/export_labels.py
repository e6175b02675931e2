# SPDX-License-Identifier: Apache-2.0
"""`objreg export-labels`: the objects of a run as labels of its pictures, to train a detector on."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import click
from tqdm import tqdm

from objreg_ros.memory.store import Store
from objreg_ros.registrar.params import RegistrarParams
from objreg_tools.cli import NOTHING, options
from objreg_tools.cli.paths import InputPath, OutputPath
from objreg_tools.cli.recorded import Opened, RecordedOptions
from objreg_tools.cli.settings import print_ignored
from objreg_tools.cli.verbosity import aside
from objreg_tools.report.labels.dataset import FORMATS
from objreg_tools.report.labels.label_export import LEAST_VIEWS, PAGE, Exported, LabelOptions, export_labels
from objreg_tools.report.labels.label_names import read_names, unknown
from objreg_tools.report.labels.labelled_pictures import LEAST_SHARE
from objreg_tools.report.labels.mapped_objects import MappedObject, mapped_objects
from objreg_tools.report.run.pictures import Album
from objreg_tools.report.run.run_summary import RunSummary


@click.command()
@options.recording
@click.option("--format", "layout", type=click.Choice(FORMATS), default=FORMATS[0], show_default=True,
              help="The layout: of Ultralytics, or instances.json with masks.")  # fmt: skip
@click.option("--out", type=OutputPath(file_okay=False, path_type=Path), default=Path("labels"), show_default=True,
              help="The folder of the data set, new or empty.")  # fmt: skip
@click.option("--names", "names_file", type=InputPath(exists=True, dir_okay=False, path_type=Path),
              help="YAML of names by object, as an earlier export wrote it: 12: mug. '' leaves one out.")  # fmt: skip
@click.option("--name", "pairs", multiple=True, metavar="ID=NAME", help="Name one object; before --names.")
@click.option("--named-only", is_flag=True, help="Leave out objects without a name; else their class is thing.")
@click.option("--every", type=click.IntRange(min=1), default=1, show_default=True, help="One picture of so many.")
@click.option("--least-share", type=click.FloatRange(0.0, 1.0), default=LEAST_SHARE, show_default=True,
              help="How much of an object's outline is seen for it to be labelled.")  # fmt: skip
@click.option("--least-views", type=click.IntRange(min=1), default=LEAST_VIEWS, show_default=True,
              help="How many keyframes saw an object that is labelled.")  # fmt: skip
@options.of_run
def command(recording: Path, out: Path, names_file: Path | None, pairs: tuple[str, ...], **given: Any) -> int:
    """Label the pictures of RECORDING with the objects of a run: a data set to train a detector on.

    An object that the registrar knows is labelled in every picture that shows it, whether or not the detector saw it
    there: its points on the corrected map are projected, and compared with the depth of the picture. Where something is
    before it, the box is that of the visible part. A name given to an object names it in all pictures; the ids are on
    the page OUT/labels.html and in OUT/names.yaml, and the same run gives the same ids again.

    Blocks of time train and validate. Ends with 3 if no picture shows an object.
    """
    asked = RecordedOptions.of(**{name: given.pop(name) for name in options.OF_RUN})
    names = read_names(names_file, pairs)
    wanted = LabelOptions(names=names, **given)
    print_ignored(asked.settings)
    if out.is_dir() and any(out.iterdir()):
        raise ValueError(f"--out: expected a new or empty folder, got {out}, which holds something; choose another")
    with asked.opened(recording) as opened, TemporaryDirectory() as folder:
        if opened.odometry is None:
            raise ValueError("--odometry none: expected a trajectory, by which objects are tracked; try tracked")
        for note in opened.notes:
            click.echo(f"! {note}", err=True)
        found, objects, summary = run_on_map(opened, Path(folder, "keyframes.db"))
        for number in unknown(names, objects):
            click.echo(f"! names: this run has no object {number}: {names[number]!r} names nothing", err=True)
        poses = [(frame.stamp_ns, frame.T_map_camera) for frame in found.map.frames]
        album = Album(opened.source, opened.inputs, summary["rectified"])
        with tqdm(
            total=len(poses[:: wanted.every]), unit="picture", desc="labelling", disable=None, leave=False
        ) as bar:
            written = export_labels(out, recording.resolve().stem, objects, poses, album, wanted, bar.update)
    _say(written, len(objects))
    click.echo(f"wrote {written.file}; look at {out / PAGE}")
    return 0 if sum(written.pictures.values()) else NOTHING


def run_on_map(opened: Opened, store: Path) -> tuple[RunSummary, tuple[MappedObject, ...], Mapping[str, Any]]:
    """The run on its corrected map, its objects there, and its JSON; an own store has no object of another run."""
    settings = opened.asked.settings.of("registrar", RegistrarParams)
    with tqdm(total=opened.frames, unit="frame", desc="running", disable=None, leave=False) as bar:
        run = opened.run(settings.replaced(store=str(store)), lambda count: bar.update(count - bar.n))
    summary = opened.summary(run, sys.argv[1:])
    found = RunSummary.of(opened.path.name, summary, opened.truth)
    read = Store(store, read_only=True)
    try:
        return found, mapped_objects(read, {frame.stamp_ns: frame.T_map_camera for frame in found.map.frames}), summary
    finally:
        read.close()


@aside()
def _say(written: Exported, objects: int) -> None:
    parts = ", ".join(f"{count} {part}" for part, count in written.pictures.items())
    click.echo(f"{objects} objects; pictures: {parts}; {written.unlabelled} show none and are left out")
    for name, count in sorted(written.labels.items()):
        click.echo(f"  {name}: {count} labels")
