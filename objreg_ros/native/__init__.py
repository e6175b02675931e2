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
import sys
from functools import cache
from pathlib import Path
from types import ModuleType, TracebackType
from typing import Any, NoReturn

from objreg_ros.native.sources import fingerprint

BUILD = "python setup.py build_ext --inplace"
NEEDS_COMPILER = ", which needs a C++ compiler (apt-get install g++ python3-dev)"
NEEDS = {"avx2", "bmi2", "fma"}  # of a processor, for the fast build
PROCESSOR = Path("/proc/cpuinfo")


class UnbuiltError(ImportError):
    """The kernels are not built, or of other sources; the message has the command that builds them.

    A process that it ends says the message in one line, not the imports that led to it, and exits with 1.
    """


def kernels(file: str) -> Any:
    """The kernels of a file, by its name; `UnbuiltError` where they are not built."""
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
    except ModuleNotFoundError:
        _refuse(name, root, f"the kernels' build {name!r}, got none", NEEDS_COMPILER)
    if (expected := fingerprint(root)) != module.sources:
        _refuse(name, root, f"kernels built of the sources {expected}, got {module.sources}")
    return module


def _refuse(name: str, root: Path, expected: str, needs: str = "") -> NoReturn:
    command = ("OBJREG_CHECKED=1 " if name == "checked" else "") + BUILD
    _end_in_one_line()
    raise UnbuiltError(f"expected {expected}: run  {command}  in {root}{needs}")


@cache
def _end_in_one_line() -> None:
    """From now on an `UnbuiltError` that ends the process is one line; anything else as before."""
    before = sys.excepthook

    def end(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
        if isinstance(error, UnbuiltError) and sys.stderr is not None:
            print(f"objreg_ros: {error}", file=sys.stderr)
        else:
            before(kind, error, trace)

    sys.excepthook = end
