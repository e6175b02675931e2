# SPDX-License-Identifier: Apache-2.0
"""ROS around an adapter."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:  # a conftest.py must load where there is no ROS
    from .standing_by import Around


@pytest.fixture
def around(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., Around]]:
    """Begins ROS with parameters, once; what was made ends with the test."""
    import rclpy

    from .standing_by import Around, begin

    monkeypatch.setenv("ROS_LOG_DIR", str(tmp_path))
    made: list[Around] = []

    def make(*parameters: str) -> Around:
        begin(monkeypatch, *parameters)
        made.append(Around())
        return made[-1]

    yield make
    for one in made:
        one.close()
    rclpy.try_shutdown()
