# SPDX-License-Identifier: Apache-2.0
"""Furniture and rooms: what stands on what, and closed walls."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_ros.data.images import Intrinsics
from objreg_tools.simulation.rendering.light import looking
from objreg_tools.simulation.rendering.raster import rasterise
from objreg_tools.simulation.world import furniture, print_design
from objreg_tools.simulation.world.mesh import Material, merge

WIDE = Intrinsics(fx=40.0, fy=40.0, cx=39.5, cy=29.5, width=80, height=60)


@pytest.mark.parametrize("kind", [furniture.table, furniture.shelf, furniture.cupboard])
def test_every_board_is_a_surface_of_its_piece(kind) -> None:  # type: ignore[no-untyped-def]
    for seed in range(5):
        piece = kind(np.random.default_rng(seed))
        assert piece.mesh.bounds[0, 2] == pytest.approx(0.0, abs=1e-6) and piece.boards
        flat = piece.mesh.vertices[piece.mesh.normals[:, 2] > 0.99][:, 2]
        low, high = piece.mesh.bounds
        for x, y, height, half_x, half_y in piece.boards:
            assert np.abs(flat - height).min() < 2e-3
            assert low[0] < x - half_x and x + half_x < high[0] and low[1] < y - half_y and y + half_y < high[1]


def test_the_boards_of_a_shelf_leave_the_clearance_that_it_states() -> None:
    piece = furniture.shelf(np.random.default_rng(0))
    heights = sorted(board[2] for board in piece.boards)
    assert min(np.diff(heights)) > piece.clearance > 0.2


def test_a_room_is_closed_on_all_sides() -> None:
    for seed in range(3):
        room = furniture.room(np.random.default_rng(seed), (2.5, 2.0))
        mesh = merge([room.mesh, room.ceiling])
        for target in [(1, 0, 1.3), (-1, 0, 1.3), (0, 1, 1.3), (0, -1, 1.3), (0.1, 0, 9), (0.1, 0, -9)]:
            view = looking(np.array([0.0, 0.0, 1.3]), np.array(target, float), np.array([0.0, 0.3, 1.0]))
            depth, _ = rasterise(mesh.vertices, mesh.faces, mesh.open_surface, view, WIDE)
            assert (depth > 0).all() and depth.max() < 4.0


def test_posters_that_are_given_hang_again_and_again_and_no_other_picture_does() -> None:
    posters = [Material(print_design.poster(np.random.default_rng(seed))) for seed in (1, 2)]
    mesh = furniture.room(np.random.default_rng(0), (4.4, 3.2), posters=posters).mesh
    hung = [mesh.vertices[mesh.faces[mesh.material == k]] for k, one in enumerate(mesh.materials) if one in posters]
    counts = [len(faces) // 12 for faces in hung]  # a box has twelve
    assert len(hung) >= 2 and sum(counts) >= 5
    heights = {round(float(np.ptp(box[..., 2])), 3) for faces in hung for box in np.split(faces, len(faces) // 12)}
    assert heights == {0.8}


def test_an_open_wall_lets_one_see_out_of_its_middle_and_nowhere_else() -> None:
    for seed in range(3):
        room = furniture.room(np.random.default_rng(seed), (2.5, 2.0), open_to=(270,))
        out, left, above = (_depth(room, np.array([3.0, y, z])) for y, z in ((0.0, 1.2), (1.1, 1.2), (0.0, 2.5)))
        assert (out == 0).all() and (left > 0).all() and (above > 0).all()


def _depth(room: furniture.Room, target: np.ndarray) -> np.ndarray:
    """What a camera of a small view in the middle of a room measures towards a point."""
    narrow = Intrinsics(fx=400.0, fy=400.0, cx=9.5, cy=9.5, width=20, height=20)
    view = looking(np.array([0.0, 0.0, 1.3]), target, np.array([0.0, 0.0, 1.0]))
    mesh = merge([room.mesh, room.ceiling])
    return rasterise(mesh.vertices, mesh.faces, mesh.open_surface, view, narrow)[0]
