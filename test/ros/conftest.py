# SPDX-License-Identifier: Apache-2.0
"""A live graph of real processes."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:  # a conftest.py must load where there is no ROS and no onnx
    from .graph import Graph


@pytest.fixture(scope="module")
def graph(domain: int, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Graph]:
    """A graph without nodes; ends every process that a test leaves."""
    from .graph import Graph

    made = Graph(domain, tmp_path_factory.mktemp("graph"))
    yield made
    made.close()


@pytest.fixture(scope="session")
def tiny_model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A detector that sees one cup in the middle of every picture."""
    from detector.tiny_model import save_constant_model, tf_outputs

    folder = tmp_path_factory.mktemp("model")
    (folder / "labelmap.txt").write_text("cup\ntv\n")
    return save_constant_model(folder / "tiny.onnx", tf_outputs([[0.3, 0.3, 0.7, 0.7]], [0], [0.9]))
