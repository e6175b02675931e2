# SPDX-License-Identifier: Apache-2.0
"""The nine classes: size, stand, variation, and the symmetry that their geometry really has."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_tools.simulation.world.objects import LABELS, make_object
from simulation.motions import about, gap

# The largest extent in metres that things of this class have in the world.
EXTENT = {
    "cap": (0.15, 0.35),
    "cereal_box": (0.19, 0.36),
    "soda_can": (0.09, 0.18),
    "chair": (0.7, 1.4),
    "monitor": (0.35, 0.85),
    "bowl": (0.1, 0.3),
    "flashlight": (0.1, 0.3),
    "book": (0.15, 0.33),
    "keyboard": (0.26, 0.47),
}


@pytest.mark.parametrize("label", LABELS)
def test_instances_are_as_large_as_the_real_things_and_stand_on_the_ground(label: str) -> None:
    for seed in range(8):
        model = make_object(label, seed)
        low, high = EXTENT[label]
        assert low < model.size.max() < high
        assert model.mesh.bounds[0, 2] == pytest.approx(0.0, abs=2e-3)
        assert np.isfinite(model.mesh.normals).all() and model.label == label


@pytest.mark.parametrize("label", LABELS)
def test_instances_differ_in_size_and_print_and_the_same_seed_is_the_same_instance(label: str) -> None:
    sizes = np.array([make_object(label, seed).size for seed in range(6)])
    assert len(np.unique(sizes.round(5), axis=0)) == 6
    first, again, other = (make_object(label, seed) for seed in (1, 1, 2))
    assert np.array_equal(first.mesh.vertices, again.mesh.vertices)
    pictures = [np.concatenate([m.texture.ravel() for m in model.mesh.materials]) for model in (first, again, other)]
    assert np.array_equal(pictures[0], pictures[1]) and not np.array_equal(pictures[0], pictures[2])


@pytest.mark.parametrize("label", ["soda_can", "bowl", "flashlight"])
def test_turning_a_body_of_revolution_by_a_step_of_its_mesh_leaves_its_shape(label: str) -> None:
    model = make_object(label, 3)
    axis, centre = model.symmetry.axis, model.symmetry.centre
    assert axis is not None and centre is not None
    name = "xyz"[int(np.argmax(axis))]
    # the longest common step of meshes with 28 and 36 segments is a quarter turn
    assert gap(model.mesh, about(name, 90.0, centre)) < 0.006


@pytest.mark.parametrize("label", ["cereal_box", "book"])
def test_half_turns_leave_the_shape_of_a_box_and_of_a_book(label: str) -> None:
    model = make_object(label, 4)
    assert model.symmetry.turns is not None and len(model.symmetry.turns) == 4
    for motion in model.symmetry.turns:
        corners = model.mesh.placed(motion).bounds
        np.testing.assert_allclose(corners, model.mesh.bounds, atol=0.015)


@pytest.mark.parametrize("label", ["chair", "monitor", "cap", "keyboard"])
def test_what_has_no_symmetry_claims_none(label: str) -> None:
    symmetry = make_object(label, 0).symmetry
    assert symmetry.axis is None and (symmetry.turns is None or len(symmetry.turns) == 1)


def test_the_names_of_fronts_are_kept() -> None:
    monitor = make_object("monitor", 0).mesh
    lit = [k for k, material in enumerate(monitor.materials) if material.gloss == 6 and material.specular >= 0.1]
    glass = np.isin(monitor.material, lit)
    assert monitor.normals[monitor.faces[glass]].reshape(-1, 3)[:, 1].min() == pytest.approx(-1.0)  # towards -y
    cap = make_object("cap", 0).mesh
    assert cap.vertices[:, 0].max() > -cap.vertices[:, 0].min() * 0.8 and np.ptp(cap.vertices, axis=0).argmax() == 0


def test_an_unknown_class_is_refused_with_those_there_are() -> None:
    with pytest.raises(ValueError, match="expected one of cap, cereal_box"):
        make_object("teapot", 0)
