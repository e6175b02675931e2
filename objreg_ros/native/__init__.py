# SPDX-License-Identifier: Apache-2.0
"""The kernels: loops over pixels and points in C++ 17, compiled when the package is built.

The kernels of ``x.py`` are in ``native/x.hpp`` beside it, and `files.hpp` lists them all. `array.hpp` has the arrays as
kernels see them, `binding.hpp` makes functions of Python of them. Three builds of the same: ``plain`` runs on any
processor, ``fast`` on those with AVX2 and FMA (x86-64-v3); ``checked`` looks at every index, and is only built and
taken where the environment has ``OBJREG_CHECKED=1``. `sources` marks a build with the sources that it is of.
"""

from __future__ import annotations

import importlib
import os
import platform
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

from objreg_ros.native.sources import fingerprint

BUILD = "python setup.py build_ext --inplace"
NEEDS = {"avx2", "bmi2", "fma"}  # of a processor, for the fast build
PROCESSOR = Path("/proc/cpuinfo")


def kernels(file: str) -> Any:
    """The kernels of a file, by its name; ImportError, with the command that builds them, where they are not built."""
    return getattr(_build(), file)


def chosen_build() -> str:
    """The build that this process takes: ``plain``, ``fast`` or ``checked``."""
    if os.environ.get("OBJREG_CHECKED"):
        return "checked"
    if platform.machine() != "x86_64" or not PROCESSOR.exists():  # an emulated ARM shows the host's processor
        return "plain"
    return "fast" if set(PROCESSOR.read_text().split()) >= NEEDS else "plain"


@cache
def _build() -> ModuleType:
    name, root = chosen_build(), Path(__file__).resolve().parents[2]
    try:
        module = importlib.import_module(f"objreg_ros.native.{name}")
    except ModuleNotFoundError as error:
        more = "OBJREG_CHECKED=1 " if name == "checked" else ""
        raise ImportError(
            f"expected the kernels' build {name!r}, got none: run  {more}{BUILD}  in {root}, "
            "which needs a C++ compiler (apt-get install g++ python3-dev)"
        ) from error
    if (expected := fingerprint(root)) != module.sources:
        raise ImportError(
            f"expected kernels built of the sources {expected}, got {module.sources}: run  {BUILD}  in {root}"
        )
    return module
