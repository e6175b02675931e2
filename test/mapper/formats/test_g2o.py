# SPDX-License-Identifier: Apache-2.0
"""What is written is what g2o's readers expect."""

from __future__ import annotations

import numpy as np

from objreg_mapper.formats.g2o import edge_text, graph_text

from .blank import CONSTRAINT, LOCAL_INFORMATION_DIAGONAL, QUARTER_LEFT

HALF = np.sqrt(0.5)


def test_an_edge_has_ids_pose_and_the_upper_triangle_translation_first() -> None:
    tag, a, b, *numbers = edge_text(3, 8, CONSTRAINT).split()
    assert (tag, a, b, len(numbers)) == ("EDGE_SE3:QUAT", "3", "8", 7 + 21)
    values = np.array(numbers, float)
    np.testing.assert_allclose(values[:7], [1, 2, 3, 0, 0, HALF, HALF], atol=1e-8)
    upper = np.zeros((6, 6))
    upper[np.triu_indices(6)] = values[7:]
    np.testing.assert_allclose(upper, np.diag(LOCAL_INFORMATION_DIAGONAL), atol=1e-12)


def test_a_graph_lists_its_vertices_fixes_the_first_and_ends_with_its_edges() -> None:
    lines = graph_text([np.eye(4), QUARTER_LEFT], [(0, 1, CONSTRAINT)]).splitlines()
    assert [line.split()[:2] for line in lines] == [
        ["VERTEX_SE3:QUAT", "0"],
        ["VERTEX_SE3:QUAT", "1"],
        ["FIX", "0"],
        ["EDGE_SE3:QUAT", "0"],
    ]
    assert graph_text([], []) == ""
