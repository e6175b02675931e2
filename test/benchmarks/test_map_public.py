# SPDX-License-Identifier: Apache-2.0
"""Tests of how g2o text is read and solved."""

from __future__ import annotations

from pathlib import Path

import pytest

SQUARE = """VERTEX_SE2 0 0 0 0
VERTEX_SE2 1 1 0.1 1.57
VERTEX_SE2 2 1.1 1 3.14
VERTEX_SE2 3 0 1.1 -1.57
EDGE_SE2 0 1 1 0 1.5707963 100 0 0 100 0 400
EDGE_SE2 1 2 1 0 1.5707963 100 0 0 100 0 400
EDGE_SE2 2 3 1 0 1.5707963 100 0 0 100 0 400
EDGE_SE2 3 0 1.1 0 1.5707963 100 0 0 100 0 400
"""


@pytest.fixture(autouse=True)
def _gtsam() -> None:
    pytest.importorskip("gtsam", reason="the map is solved with gtsam")


def test_a_square_in_the_plane_is_solved_as_well_by_all(tmp_path: Path) -> None:
    import map_public

    file = tmp_path / "square.g2o"
    file.write_text(SQUARE)
    graph = map_public.read(file)
    assert graph.name == "square" and len(graph.dense.steps) == 3 and len(graph.dense.closures) == 1
    figures = map_public.compare(graph, robust=True)
    best = figures[map_public.LM]["chi2"]
    assert figures[map_public.START]["chi2"] > 2 * best
    for name in (map_public.BELIEVED, map_public.ROBUST):
        assert figures[name]["chi2"] == pytest.approx(best, rel=0.02) and figures[name]["left_out"] == 0


def test_a_node_that_nothing_ties_is_reported(tmp_path: Path) -> None:
    import map_public

    file = tmp_path / "loose.g2o"
    file.write_text(
        "\n".join(line for line in SQUARE.splitlines() if not line.startswith(("EDGE_SE2 1", "EDGE_SE2 3")))
    )
    with pytest.raises(ValueError, match="expected every pose tied to one before it, got none for 2"):
        map_public.read(file)
