# SPDX-License-Identifier: Apache-2.0
"""The map of a folder in the docstring of its package."""

from __future__ import annotations

import importlib
import pkgutil
import re

STAGES = (
    *("registrar", "memory", "keyframes", "registration"),
    *(f"registration.{name}" for name in ("kernels", "shapes", "prepare", "score", "refine", "certainty", "propose")),
    "registration.gate",
)
VERBS = {"track", "search", "process"}


def test_the_map_names_every_module_of_the_folder_and_no_other() -> None:
    for stage in STAGES:
        package = importlib.import_module(f"objreg_ros.{stage}")
        modules = {module.name for module in pkgutil.iter_modules(package.__path__) if not module.ispkg}
        named = set(re.findall(r"`(\w+)`", package.__doc__ or "")) - VERBS
        assert named == modules, stage


def test_the_map_of_registration_names_its_folders_in_their_order() -> None:
    package = importlib.import_module("objreg_ros.registration")
    folders = {module.name for module in pkgutil.iter_modules(package.__path__) if module.ispkg}
    named = re.findall(r"^(\w+)   ", package.__doc__ or "", flags=re.M)
    assert set(named) == folders and len(named) == len(folders)
