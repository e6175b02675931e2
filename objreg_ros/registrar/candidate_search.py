# SPDX-License-Identifier: Apache-2.0
"""The search for places that a keyframe shows again: stored keyframes are tried, the likeliest first."""

from __future__ import annotations

import os
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import NamedTuple

from objreg_ros.data.checked import Array
from objreg_ros.data.closures import Reason, Rejected
from objreg_ros.memory.retrieval import CandidateKeyframe
from objreg_ros.memory.store import Store, StoreError
from objreg_ros.registrar.closure import Decision, redundant, rejected
from objreg_ros.registrar.confirmation import Confirmation
from objreg_ros.registrar.consistency import Standpoint
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registrar.rivalry import Rivalry, may_rival, rivals
from objreg_ros.registrar.thinning import Thinning
from objreg_ros.registrar.vetoes import VETOED, Vetoes
from objreg_ros.registration import align
from objreg_ros.registration.api import Gate, Method
from objreg_ros.registration.gate.refusal import Refusal
from objreg_ros.registration.keyframe import Keyframe
from objreg_ros.registration.propose.prior import Prior, expect
from objreg_ros.registration.result import Registration, evidence_of

RIVAL_TRIES = 2  # of keyframes in other places, for one that is accepted
RIVAL_VOTES = 0.5  # of the most that is left, that a rival has


class Budget(NamedTuple):
    """Until when new candidate keyframes are tried: a time of `time.monotonic`, or until ``hurried`` says so."""

    deadline: float
    hurried: Callable[[], bool]

    def over(self) -> str:
        """Why no more candidate keyframe is tried; empty while there is time."""
        late = time.monotonic() - self.deadline
        if late > 0:
            return f"{1e3 * late:.0f} ms after the end of the search"
        return "cut short: newer keyframes wait, or the node ends" if self.hurried() else ""


class Pools:
    """Threads that try candidates: so many for each niceness, which a thread may not take back."""

    def __init__(self, threads: int) -> None:
        self._threads, self._pools = threads, dict[int, ThreadPoolExecutor]()

    def fitting(self) -> ThreadPoolExecutor:
        """That of the niceness of the thread that asks; kept, since each new one costs memory."""
        nice = os.getpriority(os.PRIO_PROCESS, threading.get_native_id()) if sys.platform == "linux" else 0
        if nice not in self._pools:
            self._pools[nice] = ThreadPoolExecutor(self._threads, "register")
        return self._pools[nice]

    def shutdown(self) -> None:
        """Wait for what they are at, and end them."""
        for pool in self._pools.values():
            pool.shutdown()


class Means(NamedTuple):
    """What every search uses: the stored keyframes, how they are registered and judged, the threads that do it."""

    store: Store
    method: Method
    gate: Gate
    confirmation: Confirmation
    pool: ThreadPoolExecutor
    vetoes: Vetoes
    rivalry: Rivalry | None = None


class Found(NamedTuple):
    """What the candidates of one keyframe came to, in the order in which they were tried.

    ``alike`` says why nothing decides where it fits two places of a map and closes with none, and is empty elsewhere.
    """

    accepted: list[Decision]
    waiting: list[Decision]
    refused: list[Rejected]
    alike: str = ""


_Try = tuple[CandidateKeyframe, Callable[[], Decision | Rejected] | None]
"""A candidate keyframe that is being tried, and what waits for the decision on it."""


class Search:
    """The search for one ``keyframe``; ``thinning`` knows what was accepted before, and learns what is now."""

    def __init__(
        self, keyframe: Keyframe, thinning: Thinning, budget: Budget, means: Means, params: RegistrarParams
    ) -> None:
        self._keyframe, self._thinning, self._budget = keyframe, thinning, budget
        self._means, self._params = means, params
        self._trying = deque[_Try]()

    def run(self, candidates: Iterable[CandidateKeyframe]) -> Found:
        """Try the candidates, best first, until enough closures are accepted or ``params.candidates`` were tried."""
        found = Found([], [], [])
        queue, tries = deque(candidates), self._params.candidates
        while len(found.accepted) < self._params.closures:
            self._begin(queue, tries, self._params.closures - len(found.accepted))
            if not self._trying:
                break
            stored, ask = self._trying.popleft()
            if ask is None or self._is_redundant(stored):
                found.refused.append(self._redundant(stored))
                continue
            tries -= 1
            decision = ask()
            if isinstance(decision, Rejected):
                found.refused.append(decision)
            elif decision.accepted:
                self._thinning.accept(stored.session, stored.stamp_ns, self._keyframe.stamp_ns)
                found.accepted.append(decision)
            else:
                found.waiting.append(decision)
        rivalry = self._means.rivalry
        return found if rivalry is None or not found.accepted else self._without_rivals(found, queue, rivalry)

    def _without_rivals(self, found: Found, queue: deque[CandidateKeyframe], rivalry: Rivalry) -> Found:
        """What is left of all that was found where other places of the same maps fit as well."""
        for one in {d.target.session: d for d in reversed(found.accepted)}.values():  # the first of each map
            found = self._without_rivals_of(one, found, queue, rivalry)
        known = any(one.target.session != self._keyframe.session for one in found.accepted)
        return found._replace(alike="") if known else found

    def _without_rivals_of(
        self, one: Decision, found: Found, queue: deque[CandidateKeyframe], rivalry: Rivalry
    ) -> Found:
        other = next((d for d in (*found.accepted, *found.waiting) if rivals(one, d, self._params)), None)
        other = other or self._rival(one, queue)
        if other is None:
            return self._as_remembered(one, found, rivalry)
        winner, why = rivalry.winner(self._keyframe, one, other)
        detail = f"{why}; nothing decides" if winner is None else f"{why}: another place"
        alike = detail if winner is None else found.alike
        kept, every = Found([], [], found.refused, alike), [*found.accepted, *found.waiting]
        for decision in every if other in every else [*every, other]:
            if winner is None or rivals(winner, decision, self._params):
                self._withdraw(decision, found.accepted)
                kept.refused.append(self._refused_as(decision, (Reason.ALIKE, detail)))
            else:
                if decision.accepted and decision not in found.accepted:
                    self._thinning.accept(decision.target.session, decision.target.stamp_ns, self._keyframe.stamp_ns)
                (kept.accepted if decision.accepted else kept.waiting).append(decision)
        return kept

    def _as_remembered(self, one: Decision, found: Found, rivalry: Rivalry) -> Found:
        """What is left where this keyframe shows no rival: nothing at a place that has one which is not ruled out."""
        why = rivalry.doubt(self._keyframe, one)
        if not why:
            return found
        kept = Found([], [], found.refused, why)
        for decision in (*found.accepted, *found.waiting):
            if decision.target.session == one.target.session:
                self._withdraw(decision, found.accepted)
                kept.refused.append(self._refused_as(decision, (Reason.ALIKE, why)))
            else:
                (kept.accepted if decision.accepted else kept.waiting).append(decision)
        return kept

    def _rival(self, one: Decision, queue: deque[CandidateKeyframe]) -> Decision | None:
        """A pose in another place than one that was accepted, among what is likely and was not tried; mostly None."""
        likely = [(stored, ask) for stored, ask in self._trying] + [(stored, None) for stored in queue]
        likely = [of for of in likely if of[0].session == one.target.session != self._keyframe.session]
        least = RIVAL_VOTES * max((stored.votes for stored, _ in likely), default=0.0)
        tries = RIVAL_TRIES
        for stored, ask in likely:
            if stored.votes < least or tries == 0:
                continue
            try:
                target = self._means.store.keyframe(stored.keyframe_id)
            except StoreError:
                continue
            if may_rival(self._keyframe, one, target, self._params):
                tries -= 1
                decision = (ask or self._try_candidate(stored))()
                if isinstance(decision, Decision) and rivals(one, decision, self._params):
                    return decision
        return None

    def _withdraw(self, decision: Decision, accepted: list[Decision]) -> None:
        self._means.confirmation.leave_out(decision)
        if decision in accepted:
            target = decision.target
            self._thinning.withdraw(target.session, target.stamp_ns, self._keyframe.stamp_ns)

    def _refused_as(self, decision: Decision, refusal: Refusal) -> Rejected:
        refused = rejected(decision.target.stamp_ns, self._keyframe, refusal, decision.target)
        pose, evidence = decision.candidate.T_target_source, evidence_of(decision.candidate)
        return replace(refused, T_from_to=pose, evidence=evidence)

    def _is_redundant(self, stored: CandidateKeyframe) -> bool:
        return self._thinning.redundant(stored.session, stored.stamp_ns, self._keyframe.stamp_ns)

    def _redundant(self, stored: CandidateKeyframe) -> Rejected:
        return rejected(stored.stamp_ns, self._keyframe, redundant(self._params.thin_seconds))

    def _begin(self, queue: deque[CandidateKeyframe], tries: int, wanted: int) -> None:
        """Begin to try the next candidates: as many at once as there are threads, and never more than ``tries``.

        While some are being tried, no more than would be ``wanted`` if all of them were accepted. What would say what
        is said already is put aside without a try. Verdicts are asked for in the order of the candidates, so it does
        not matter which is done first.
        """
        busy, threads = sum(ask is not None for _, ask in self._trying), self._params.threads
        most = min(tries, threads if busy == 0 else min(wanted, threads))
        while queue and busy < most:
            stored = queue.popleft()
            redundant = self._is_redundant(stored)
            self._trying.append((stored, None if redundant else self._try_candidate(stored)))
            busy += not redundant

    def _try_candidate(self, stored: CandidateKeyframe) -> Callable[[], Decision | Rejected]:
        """Begin to register a candidate keyframe in a thread of its own; what comes back waits for the end of it."""
        keyframe, over = self._keyframe, self._budget.over()
        if over:
            refusal = Reason.OVER_BUDGET, over
            return lambda: rejected(stored.stamp_ns, keyframe, refusal)
        try:
            target = self._means.store.keyframe(stored.keyframe_id)
        except StoreError as error:
            refusal = Reason.UNREADABLE, str(error)
            return lambda: rejected(stored.stamp_ns, keyframe, refusal)
        method, gate, pool = self._means.method, self._means.gate, self._means.pool
        method.prepare(keyframe)
        prior = expect(keyframe, target, self._params)
        registered = pool.submit(align, keyframe, target, prior, self._params, method, gate)
        return lambda: self._decide(target, prior, registered.result())

    def _decide(self, target: Keyframe, prior: Prior | None, registration: Registration) -> Decision | Rejected:
        """What a registered pair comes to; what a person withdrew is refused, and nothing is said of it to others."""
        best = registration.candidate
        if best is None or not self._is_vetoed(target, best.T_target_source):
            return self._means.confirmation.decide(self._keyframe, target, prior, registration)
        refused = rejected(target.stamp_ns, self._keyframe, VETOED, target)
        return replace(refused, T_from_to=best.T_target_source, evidence=registration.evidence)

    def _is_vetoed(self, target: Keyframe, T_target_source: Array) -> bool:
        vetoes = self._means.vetoes
        return bool(vetoes) and vetoes.covers(Standpoint.of(self._keyframe), Standpoint.of(target), T_target_source)
