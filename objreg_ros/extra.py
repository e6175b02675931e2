# SPDX-License-Identifier: Apache-2.0
"""Libraries that an extra of setup.py brings, loaded where they are needed."""

from __future__ import annotations

from importlib import import_module
from types import ModuleType


def load(module: str, extra: str, purpose: str) -> ModuleType:
    """The library ``module``; ValueError that names the ``extra`` and the ``purpose`` where it is not installed."""
    try:
        return import_module(module)
    except ModuleNotFoundError as absent:
        problem = f"{purpose}: expected {module}, got none; pip install 'objreg_ros[{extra}]' brings it"
        raise ValueError(problem) from absent
