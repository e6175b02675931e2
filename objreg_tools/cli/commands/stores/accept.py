# SPDX-License-Identifier: Apache-2.0
"""`objreg accept`: a closure of two stored keyframes that a person knows to be right."""

from __future__ import annotations

from contextlib import closing
from dataclasses import replace
from pathlib import Path

import click

from objreg_ros.data.closure_id import closure_id
from objreg_ros.data.closures import LoopClosure
from objreg_ros.memory.sighting import Sighting
from objreg_ros.memory.store import Store
from objreg_ros.memory.store_file import require_place
from objreg_ros.registrar.closure import Decision, closure_of
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registrar.vetoes import Vetoes
from objreg_ros.registration import align, gate_of, method_of
from objreg_ros.registration.keyframe import Keyframe
from objreg_tools.cli.paths import InputPath

BY_HAND = "by hand"  # evidence of a closure that a person accepted: 1


@click.command()
@click.argument("store", type=InputPath(path_type=Path))
@click.argument("first", metavar="A", type=int)
@click.argument("second", metavar="B", type=int)
def command(store: Path, first: int, second: int) -> None:
    """Write the closure of the keyframes of STORE at the stamps A and B, in ns, though the gate refuses it.

    Its pose is the best that registration finds of the two; where that finds none, nothing is written. Its evidence
    says `by hand`. What was withdrawn stays withdrawn: see `objreg veto --undo`. No registrar may hold STORE meanwhile.
    """
    if first == second:
        raise ValueError(f"expected two keyframes, got the one at {first} ns twice")
    require_place(store, read_only=True)
    with closing(Store(store)) as opened:
        target, source = sorted((_at(opened, first), _at(opened, second)), key=lambda one: one.keyframe_id)
        closure = accepted(source, target, list(opened.sightings(source.keyframe_id)))
        if closure in Vetoes(opened.vetoes()):
            raise ValueError("expected a pair that nobody withdrew, got a vetoed one: see objreg veto --undo")
        if closure_id(closure) in map(closure_id, opened.closures()):
            raise ValueError(f"expected a pair without a closure, got that of {closure_id(closure)}")
        opened.add_closure(closure, {})
    click.echo(f"accepted by hand: {', '.join(closure.labels)}, {closure_id(closure)}")


def accepted(source: Keyframe, target: Keyframe, sightings: list[Sighting]) -> LoopClosure:
    """The closure of the best pose that registration finds, whatever the gate says; ValueError where it finds none."""
    params = RegistrarParams()
    method = method_of(params)
    for keyframe in (source, target):
        method.prepare(keyframe)
    registration = align(source, target, None, params, method, gate_of(params))
    if registration.candidate is None:
        raise ValueError(f"expected two keyframes with a pose between them, got none: {registration.detail}")
    closure = closure_of(source, sightings, Decision(target=target, candidate=registration.candidate), params)
    return replace(closure, evidence=closure.evidence | {BY_HAND: 1.0})


def _at(store: Store, stamp_ns: int) -> Keyframe:
    """The one keyframe at a stamp; ValueError where there is none, or there are several."""
    keyframes = [store.keyframe(number) for number in store.keyframes_at(stamp_ns)]
    if len(keyframes) != 1:
        raise ValueError(f"expected one keyframe at {stamp_ns} ns, got {len(keyframes)}")
    return keyframes[0]
