# SPDX-License-Identifier: Apache-2.0
"""Distractors: they stand, they differ, they are none of the nine classes, and their symmetry is real."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_tools.simulation.world import distractors
from objreg_tools.simulation.world.distractors import make_distractor
from objreg_tools.simulation.world.objects import LABELS
from simulation.motions import about, gap

ROUND = ("bottle", "vase", "lamp", "ball", "plate", "tin", "stick")


@pytest.mark.parametrize("kind", distractors.FAMILIES)
def test_distractors_stand_on_the_ground_and_differ(kind: str) -> None:
    first, again, other = (make_distractor(kind, seed) for seed in (1, 1, 2))
    assert np.array_equal(first.mesh.vertices, again.mesh.vertices)
    assert first.label == kind and not np.array_equal(first.size, other.size)
    for model in (first, other):
        assert model.mesh.bounds[0, 2] == pytest.approx(0.0, abs=5e-3) and 0.02 < model.size.max() < 0.6
        assert np.isfinite(model.mesh.normals).all()


def test_an_unknown_distractor_is_refused_with_those_there_are() -> None:
    with pytest.raises(ValueError, match="expected one of mug"):
        make_distractor("teapot", 0)


def test_no_distractor_is_one_of_the_nine_classes() -> None:
    assert not set(distractors.FAMILIES) & set(LABELS)


@pytest.mark.parametrize("kind", ROUND)
def test_a_round_distractor_looks_the_same_after_a_quarter_turn_about_its_axis(kind: str) -> None:
    model = make_distractor(kind, 3)
    axis, centre = model.symmetry.axis, model.symmetry.centre
    assert axis is not None and centre is not None
    assert gap(model.mesh, about("xyz"[int(np.argmax(axis))], 90.0, centre)) < 0.006


@pytest.mark.parametrize("kind", ["carton", "phone"])
def test_half_turns_leave_the_shape_of_a_carton_and_of_a_phone(kind: str) -> None:
    model = make_distractor(kind, 3)
    assert model.symmetry.turns is not None and len(model.symmetry.turns) == 4
    for motion in model.symmetry.turns:
        np.testing.assert_allclose(model.mesh.placed(motion).bounds, model.mesh.bounds, atol=0.0015)


@pytest.mark.parametrize("kind", sorted(set(distractors.FAMILIES) - {*ROUND, "carton", "phone"}))
def test_what_has_no_symmetry_claims_none(kind: str) -> None:
    symmetry = make_distractor(kind, 3).symmetry
    assert symmetry.axis is None and symmetry.turns is None


def test_a_mug_is_round_but_for_its_handle() -> None:
    mesh = make_distractor("mug", 0).mesh
    low, high = mesh.bounds
    assert low[0] == pytest.approx(low[1], rel=0.02) and high[0] > 1.3 * high[1]
    handle = mesh.vertices[mesh.vertices[:, 0] > 1.1 * high[1]]
    assert np.abs(handle[:, 1]).max() < 0.006 and low[2] < handle[:, 2].min() < handle[:, 2].max() < high[2]


def test_a_clock_stands_with_its_face_to_the_front() -> None:
    mesh = make_distractor("clock", 0).mesh
    width, depth, height = np.ptp(mesh.vertices, axis=0)
    assert depth == pytest.approx(0.03, abs=1e-6) and height == pytest.approx(width, rel=0.01)
    face = mesh.faces[mesh.material == 0]  # the body has another material
    np.testing.assert_allclose(mesh.normals[face], np.broadcast_to([0, -1, 0], (*face.shape, 3)), atol=1e-6)


def test_a_lit_lamp_shines_by_its_shade_alone_and_others_not_at_all() -> None:
    lamps = [make_distractor("lamp", seed) for seed in range(12)]
    shining = [[m for m in lamp.mesh.materials if m.emission] for lamp in lamps]
    assert {len(materials) for materials in shining} == {0, 1}
    for lamp, materials in zip(lamps, shining, strict=True):
        for material in materials:
            faces = lamp.mesh.faces[lamp.mesh.material == lamp.mesh.materials.index(material)]
            assert lamp.mesh.vertices[faces][..., 2].min() > 0.5 * lamp.size[2]
