# SPDX-License-Identifier: Apache-2.0
"""`objreg veto`: closures of a store withdrawn by a person, or that taken back."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path

import click

from objreg_ros.memory.store import Store
from objreg_ros.memory.store_file import require_place
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registrar.recollection import Recollection
from objreg_tools.cli.paths import InputPath


@click.command()
@click.argument("store", type=InputPath(path_type=Path))
@click.argument("ids", metavar="ID...", nargs=-1, required=True)
@click.option("--undo", is_flag=True, help="Let withdrawn closures hold again.")
@click.option("--robot", default="", metavar="NAME", help="The namespace of the registrar whose ids they are.")
def command(store: Path, ids: tuple[str, ...], undo: bool, robot: str) -> None:
    """Withdraw the closures of STORE that have these ids: a person knows that they are wrong.

    They are not found again: neither the same two keyframes, nor neighbours of the same two revisits at the same pose.
    All are withdrawn, or none where one is not known. A registrar that starts on STORE retracts them. No registrar
    may hold STORE meanwhile: one that runs has the service ~/veto. Ids are those on `loop_closures`, and of `objreg
    report`.
    """
    require_place(store, read_only=True)
    with closing(Store(store)) as opened:
        recollection = Recollection(RegistrarParams(), opened)
        closures = recollection.named(ids, robot, vetoed=undo)
        (recollection.undo_veto if undo else recollection.veto)(closures)
    for closure in closures:
        seconds = f"{1e-9 * closure.from_ns:.3f} s and {1e-9 * closure.to_ns:.3f} s"
        click.echo(f"{'holds again' if undo else 'withdrawn'}: {', '.join(closure.labels)} at {seconds}")
