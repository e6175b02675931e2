# SPDX-License-Identifier: Apache-2.0
"""The search for places that a keyframe shows again, with a method and a gate that answer as each test sets them."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any

import pytest
from registration.samples import box, candidate, keyframe, moved

from objreg_ros.bridge.node.worker import give_way
from objreg_ros.data.closures import Reason
from objreg_ros.memory.retrieval import CandidateKeyframe
from objreg_ros.memory.sighting import sightings_of
from objreg_ros.memory.store import Store
from objreg_ros.registrar.candidate_search import Budget, Means, Pools, Search
from objreg_ros.registrar.confirmation import Confirmation
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registrar.relocalisation import Relocalisation
from objreg_ros.registrar.rivalry import Rivalry
from objreg_ros.registrar.thinning import Thinning
from objreg_ros.registrar.vetoes import Vetoes
from objreg_ros.registration.candidate import Candidate

PARAMS = RegistrarParams(threads=1, closures=2, candidates=3, thin_seconds=1.0, confirm_seconds=0.0)
CUPS = (box("cup", (0.0, 0.0, 1.0)),)
ENDLESS = Budget(float("inf"), lambda: False)
STORED = (0, 10, 20, 30, 40)  # s
NOW = 90


class Recorded:
    """A method that proposes one pose for every pair, and remembers which were asked for."""

    def __init__(self) -> None:
        self.targets: list[int] = []

    def prepare(self, keyframe: object) -> None:
        """Nothing to make ready."""

    def propose(self, source: Any, target: Any, prior: object = None) -> tuple[Candidate, ...]:
        self.targets.append(round(1e-9 * target.stamp_ns))
        return (candidate(),)


def accept(candidates: Sequence[Candidate], prior: object = None) -> Candidate:
    return candidates[0]


def refuse(candidates: Sequence[Candidate], prior: object = None) -> tuple[Reason, str]:
    return Reason.GRAVITY, "9 deg"


@pytest.fixture
def means() -> Iterator[Means]:
    store = Store()
    for number, seconds in enumerate(STORED, 1):
        stored = keyframe(number, seconds, CUPS)
        store.write_keyframe(stored, sightings_of(stored))
    with ThreadPoolExecutor(1) as pool:
        yield Means(store, Recorded(), refuse, Confirmation(PARAMS), pool, Vetoes())
    store.close()


def search(means: Means, params: RegistrarParams = PARAMS, budget: Budget = ENDLESS) -> Search:
    return Search(keyframe(9, NOW, CUPS), Thinning(params.thin_seconds), budget, means, params)


def ids(*numbers: int) -> list[CandidateKeyframe]:
    return [CandidateKeyframe(number, 0, round(1e9 * STORED[number - 1]), 1.0) for number in numbers]


def test_no_more_keyframes_are_tried_than_are_asked_for_best_first(means: Means) -> None:
    accepted, _, refused = search(means).run(ids(3, 1, 5, 2, 4))[:3]
    assert accepted == [] and [one.reason for one in refused] == [Reason.GRAVITY] * 3
    assert means.method.targets == [20, 0, 40]


def test_enough_accepted_closures_end_the_search(means: Means) -> None:
    accepted, _, refused = search(means._replace(gate=accept)).run(ids(3, 1, 5, 2, 4))[:3]
    assert [item.target.keyframe_id for item in accepted] == [3, 1] and refused == []


def test_what_would_say_the_same_again_is_put_aside_without_a_try(means: Means) -> None:
    params = PARAMS.replaced(thin_seconds=15.0)
    accepted, _, refused = search(means._replace(gate=accept), params).run(ids(2, 1, 5))[:3]
    assert [item.target.keyframe_id for item in accepted] == [2, 5]
    assert [one.reason for one in refused] == [Reason.REDUNDANT]


def test_what_is_not_begun_in_time_is_refused_as_over_budget(means: Means) -> None:
    for budget in (Budget(time.monotonic() - 1.0, lambda: False), Budget(float("inf"), lambda: True)):
        accepted, _, refused = search(means, budget=budget).run(ids(1, 2))[:3]
        assert accepted == [] and [one.reason for one in refused] == [Reason.OVER_BUDGET] * 2
    assert means.method.targets == []


def test_what_waits_for_others_counts_as_tried_and_closes_nothing(means: Means) -> None:
    waits = means._replace(confirmation=Confirmation(PARAMS.replaced(confirm_seconds=10.0)))
    accepted, held, refused = search(waits).run(ids(3, 1, 5, 2))[:3]
    assert [one.target.keyframe_id for one in held] == [3, 1, 5] and not accepted and not refused


def test_a_nicer_thread_gets_a_pool_of_its_own_and_the_same_one_again() -> None:
    pools, nicer = Pools(2), list[ThreadPoolExecutor]()

    def ask() -> None:
        give_way(5)
        nicer.extend(pools.fitting() for _ in range(2))

    thread = threading.Thread(target=ask)
    thread.start()
    thread.join()
    assert pools.fitting() is pools.fitting() and nicer[0] is nicer[1] and nicer[0] is not pools.fitting()
    pools.shutdown()
    with pytest.raises(RuntimeError, match="shutdown"):
        pools.fitting().submit(print)


@pytest.fixture
def two_places() -> Iterator[Means]:
    """One session that passed by two places 6 m apart, and looks for rivals."""
    store = Store()
    for number, x in enumerate((0.0, 6.0), 1):
        there = replace(keyframe(number, STORED[number - 1], CUPS), T_odom_camera=moved(x), by_odometry=True)
        store.write_keyframe(replace(there, travelled=x), sightings_of(there))
    params = PARAMS.replaced(confirm_seconds=10.0)
    with ThreadPoolExecutor(1) as pool:
        yield Means(store, Recorded(), accept, Confirmation(params), pool, Vetoes(), Rivalry(Relocalisation()))
    store.close()


def test_of_two_places_that_fit_alike_none_is_accepted_though_enough_are(two_places: Means) -> None:
    thinning, params = Thinning(1.0), PARAMS.replaced(closures=1)
    found = Search(replace(keyframe(9, NOW, CUPS), session=1), thinning, ENDLESS, two_places, params).run(ids(1, 2))
    assert not found.accepted and not found.waiting and found.alike
    assert [one.reason for one in found.refused] == [Reason.ALIKE] * 2 and two_places.method.targets == [0, 10]
    assert "nothing decides" in found.refused[0].detail and not thinning.redundant(0, 0, round(1e9 * NOW))


def test_a_place_that_no_other_fits_is_accepted(two_places: Means) -> None:
    params = PARAMS.replaced(closures=1)
    found = Search(replace(keyframe(9, NOW, CUPS), session=1), Thinning(1.0), ENDLESS, two_places, params).run(ids(1))
    assert len(found.accepted) == 1 and not found.alike
