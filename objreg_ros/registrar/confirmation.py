# SPDX-License-Identifier: Apache-2.0
"""Between gate and publication: what one pair of keyframes cannot prove waits for others that agree.

A pose that is likely right, and that no rule makes impossible, waits until `SUPPORTERS` others agree with it by way of
odometry, and little disagrees. What the gate accepts is published at once, unless more disagrees than agrees: then it
waits as well. What waits longer than ``confirm_seconds``, or beyond the reach of odometry, is refused.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from objreg_ros.data.closures import Reason, Rejected
from objreg_ros.registrar.closure import Decision, WaitingClosure, rejected
from objreg_ros.registrar.consistency import Consistency, Standpoint, Statement, Support
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registrar.vetoes import VETOED, Vetoes
from objreg_ros.registration.candidate import Candidate
from objreg_ros.registration.certainty.covariance import spread_of
from objreg_ros.registration.gate.likelihood import odds_of
from objreg_ros.registration.gate.limits import limits_of
from objreg_ros.registration.gate.refusal import Refusal
from objreg_ros.registration.gate.verdict import check_possible
from objreg_ros.registration.keyframe import Keyframe
from objreg_ros.registration.propose.prior import Prior
from objreg_ros.registration.result import Registration

LEAST_ODDS = 5.0  # of what waits: with even odds slides of 15 to 20 cm confirm each other
LEAST_MARGIN = 0.02  # of the view score over a perturbation: where nothing holds a pose, its neighbours slide alike
SUPPORTERS = 3  # that agree with it and each other
LEAST_SHARE = 0.85  # of what is said of its place, that agrees
OPPOSED_SHARE = 0.5  # what the gate accepts waits below
COUNTS = 1.0  # what weighs less opposes nothing: one that is certain


class Confirmation:
    """Receives of every pair that was tried, and says which poses others confirm.

    It remembers statements within reach (`consistency`), and what waits. The same pairs in the same order give the same
    answers.
    """

    def __init__(self, params: RegistrarParams) -> None:
        self._limits, self._wait_ns = limits_of(params), round(1e9 * params.confirm_seconds)
        self._consistency = Consistency()
        self._waiting: dict[int, WaitingClosure] = {}
        self._contrary: list[tuple[Keyframe, Candidate]] = []  # of the newest keyframe

    def take_contrary(self) -> list[tuple[Keyframe, Candidate]]:
        """The stored keyframes, and poses in them, that only odometry or neighbours oppose; since the last call."""
        taken, self._contrary = self._contrary, []
        return taken

    def __len__(self) -> int:
        """How many wait."""
        return len(self._waiting)

    def decide(
        self, source: Keyframe, target: Keyframe, prior: Prior | None, registration: Registration
    ) -> Decision | Rejected:
        """What the registration of a pair comes to beside what was received before.

        ``prior`` is what odometry expected of it. ValueError where a gate gave no reason.
        """
        candidate, accepted = registration.candidate, registration.accepted
        if candidate is not None and registration.reason is Reason.ODOMETRY:
            self._contrary.append((target, candidate))
        if candidate is None or not (accepted or (self._wait_ns and self._possible(candidate, prior))):
            return _refused(source, target, registration)
        decision = Decision(target=target, candidate=candidate)
        if not self._wait_ns:
            return decision
        by_odometry = source.by_odometry and target.by_odometry
        number = self._consistency.add_statement(_statement(source, target, candidate, accepted, by_odometry))
        support, decision = self._consistency.support(number), replace(decision, statement=number)
        if accepted:  # where our own tracking slipped, right poses contradict each other
            waits = by_odometry and _opposed(support)
            if waits:
                self._contrary.append((target, candidate))
            return replace(decision, refusal=_opposition(support), waits_as=number) if waits else decision
        if odds_of(candidate) < LEAST_ODDS:
            return _refused(source, target, registration)
        if _confirmed(support):
            return replace(decision, support=support)
        return replace(decision, refusal=_refusal(registration), waits_as=number)

    def leave_out(self, decision: Decision) -> None:
        """Forget what a decision said: it confirms and opposes nothing."""
        if decision.statement is not None:
            self._consistency.remove_statement(decision.statement)

    def hold(self, number: int, waiting: WaitingClosure) -> None:
        """Let a held pose wait, with what its constraint needs once the keyframes are gone."""
        self._waiting[number] = waiting

    def decide_waiting(self, now_ns: int | None) -> tuple[list[WaitingClosure], list[Rejected]]:
        """What waits no more at the end of a keyframe: what is confirmed, and what is refused for good.

        All of it where ``now_ns`` is None.
        """
        confirmed, refused = [], []
        for number, waiting in list(self._waiting.items()):
            known = number in self._consistency
            support = self._consistency.support(number) if known else None
            if support is not None and self._settled(waiting, support):
                confirmed.append(waiting.confirmed(support))
            elif known and now_ns is not None and now_ns - waiting.closure.to_ns <= self._wait_ns:
                continue
            else:
                refused.append(waiting.refused(waiting.refusal))
            del self._waiting[number]
        return confirmed, refused

    def give_up(self, refusal: Refusal | None) -> list[Rejected]:
        """Refuse all that waits; for what it waits for where no other refusal is given."""
        refused = [waiting.refused(refusal or waiting.refusal) for waiting in self._waiting.values()]
        self._waiting.clear()
        return refused

    def withdraw(self, vetoes: Vetoes) -> list[Rejected]:
        """Refuse what waits and is withdrawn, and forget what was said of it: right poses contradict it."""
        gone = [number for number, waiting in self._waiting.items() if vetoes.cover_waiting(waiting)]
        self._consistency.forget_where(lambda one: vetoes.covers(one.source, one.target, one.T_target_source))
        return [self._waiting.pop(number).refused(VETOED) for number in gone]

    def _possible(self, candidate: Candidate, prior: Prior | None) -> bool:
        margin = candidate.perturbation_margin
        held = margin is None or margin >= LEAST_MARGIN
        return held and check_possible(candidate, prior, self._limits) is None

    def _settled(self, waiting: WaitingClosure, support: Support) -> bool:
        """Whether it is published after all."""
        return not _opposed(support) if waiting.accepted else _confirmed(support)


def _confirmed(support: Support) -> bool:
    return support.agreeing >= SUPPORTERS and support.share >= LEAST_SHARE


def _opposed(support: Support) -> bool:
    return support.received >= COUNTS and support.share < OPPOSED_SHARE


def _statement(
    source: Keyframe, target: Keyframe, candidate: Candidate, accepted: bool, by_odometry: bool
) -> Statement:
    variances = np.diag(spread_of(candidate.alignment))
    return Statement(
        Standpoint.of(source),
        Standpoint.of(target),
        candidate.T_target_source,
        odds_of(candidate),
        accepted,
        by_odometry,
        rotation_deg=float(np.degrees(np.sqrt(variances[3:].sum()))),
        translation_m=float(np.sqrt(variances[:3].sum())),
    )


def _refusal(registration: Registration) -> Refusal:
    """Why the gate refused; ValueError where it gave no reason."""
    if registration.reason is None:
        raise ValueError("gate: expected a reason with each refusal, got None")
    return registration.reason, registration.detail


def _refused(source: Keyframe, target: Keyframe, registration: Registration) -> Rejected:
    best = registration.candidate
    pose = None if best is None else best.T_target_source
    refused = rejected(target.stamp_ns, source, _refusal(registration), target)
    return replace(refused, T_from_to=pose, evidence=registration.evidence)


def _opposition(support: Support) -> Refusal:
    return Reason.NEIGHBOURS, f"{support.share:.2f} < {OPPOSED_SHARE} of what is said of its place agrees"
