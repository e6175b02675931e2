# SPDX-License-Identifier: Apache-2.0
"""What a registered pair comes to."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from registration.samples import box, candidate, keyframe

from objreg_ros.data.closures import Reason
from objreg_ros.memory.sighting import sightings_of
from objreg_ros.registrar.closure import Decision, closure_of, links_of, observations, rejected
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registration.candidate import ObjectPair

PARAMS = RegistrarParams()
CUP = box("cup", (0.0, 0.0, 1.0))
NEW, STORED = keyframe(2, 2, (CUP,)), keyframe(1, 1, (CUP,))


def test_a_closure_names_each_label_once_and_the_farthest_of_several_that_moved() -> None:
    here, there = (
        keyframe(number, number, tuple(box("cup", (x, 0.0, 1.0), instance=k) for k, x in enumerate(places, 1)))
        for number, places in ((2, (0.0, 0.3, 0.6, 0.9)), (1, (0.0, 0.3, 1.1, 1.0)))
    )
    pairs = [ObjectPair(k, k, "cup") for k in range(4)]
    sightings = [seen.of_landmark(number, np.eye(3)) for number, seen in enumerate(sightings_of(here), 7)]
    accepted = Decision(
        target=replace(there, frame_id="front"), candidate=candidate(matched=pairs[:2], moved=pairs[2:])
    )
    closure = closure_of(here, sightings, accepted, PARAMS)
    assert closure.labels == ("cup",) and [match.object_id for match in closure.objects] == [7, 8]
    assert closure.moved == {"cup": pytest.approx(0.5)}
    assert (closure.from_ns, closure.to_ns) == (there.stamp_ns, here.stamp_ns)
    assert (closure.from_frame_id, closure.to_frame_id) == ("front", "camera")


def test_a_closure_and_a_refusal_name_the_sessions_of_their_moments_as_far_as_they_are_known() -> None:
    here, refusal = replace(NEW, session=4), (Reason.OVER_BUDGET, "0 s")
    sightings = [seen.of_landmark(7, np.eye(3)) for seen in sightings_of(here)]
    accepted = Decision(target=STORED, candidate=candidate(matched=(ObjectPair(0, 0, "cup"),)))
    closure = closure_of(here, sightings, accepted, PARAMS)
    assert (closure.from_session, closure.to_session) == (STORED.session, 4)
    stored, unread = rejected(1, here, refusal, STORED), rejected(1, here, refusal)
    assert (stored.from_session, stored.from_frame_id, stored.to_session) == (STORED.session, STORED.frame_id, 4)
    assert (unread.from_session, unread.from_frame_id, unread.to_frame_id) == (None, "", here.frame_id)


def test_a_link_says_which_stored_object_an_object_is_and_how_it_is_turned() -> None:
    found = candidate(matched=(ObjectPair(0, 0, "cup"),))
    stored = sightings_of(STORED)
    (link,) = links_of(NEW, Decision(target=STORED, candidate=found), stored)
    assert link.index == 0 and link.of is stored[0]
    assert np.allclose(link.R_there_here, found.T_target_source[:3, :3])


def test_objects_are_observed_under_the_ids_of_their_landmarks() -> None:
    sightings = [seen.of_landmark(7, np.eye(3)) for seen in sightings_of(NEW)]
    (seen,) = observations(NEW, sightings)
    assert (seen.label, seen.object_id) == ("cup", 7) and np.allclose(seen.xyz, NEW.objects[0].centroid)
