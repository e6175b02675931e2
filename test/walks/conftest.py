# SPDX-License-Identifier: Apache-2.0
"""The recording that most walks begin with."""

from __future__ import annotations

from pathlib import Path

import pytest

from .walk import ROOM, Walk


@pytest.fixture(scope="module")
def room(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A simulated recording, from which the command leads on."""
    folder = tmp_path_factory.mktemp("walks")
    assert Walk(folder).type("simulate", "room", *ROOM).command() == ["inspect", "room"]
    return folder / "room"
