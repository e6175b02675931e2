# SPDX-License-Identifier: Apache-2.0
"""The map of the room in the docstring of its folder."""

from __future__ import annotations

import re
from pathlib import Path

from objreg_ros import registrar


def test_the_map_names_every_module_of_the_folder_and_no_other() -> None:
    modules = {file.stem for file in Path(registrar.__file__).parent.glob("*.py")} - {"__init__"}
    verbs = {"track", "search", "process"}
    assert set(re.findall(r"`(\w+)`", registrar.__doc__ or "")) - verbs == modules
