# SPDX-License-Identifier: Apache-2.0
"""Tests that no kernel is left to be compiled when the first frame comes."""

from __future__ import annotations

import importlib
import json
import os
import pkgutil
import subprocess
import sys
from pathlib import Path

from registration.rooms import keyframe, seen_from

from objreg_ros import keyframes, memory, registration
from objreg_ros.data.frames import Frame
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registrar.registrar import Registrar
from objreg_ros.registrar.warm import warm

ROOT = Path(__file__).parents[2]
# In a process of its own: what other tests have compiled says nothing of `warm`.
FRESH = """
import json
from registrar.test_warm import kernels, real_run
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registrar.warm import warm
warm(RegistrarParams())
before = kernels()
real_run()
print(json.dumps([before, kernels()]))
"""


def kernels() -> dict[str, list[str]]:
    """The signatures that each compiled function of the registrar's folders has been called with from Python."""
    found = {}
    for room in (keyframes, memory, registration):
        for module in pkgutil.walk_packages(room.__path__, f"{room.__name__}."):
            for name, value in vars(importlib.import_module(module.name)).items():
                if getattr(value, "__module__", "") == module.name and hasattr(value, "signatures"):
                    found[f"{module.name}.{name}"] = sorted(map(str, value.signatures))
    return found


def real_run() -> None:
    """A room that is seen twice: as it is, then without gravity, without odometry, without grey."""
    for lacking in ("", "gravity", "T_odom_camera", "grey"):
        registrar = Registrar(RegistrarParams())
        for second, angle in enumerate((0, 2, 20, 22, 4, 6, 24, 26)):
            registrar.process(frame(float(angle), second, lacking))
        registrar.finish()
        registrar.close()


def frame(angle: float, second: int, lacking: str) -> Frame:
    T = seen_from(angle)
    taken = keyframe(T, seed=second, gravity=lacking != "gravity", grey=lacking != "grey")
    return Frame(
        objects=tuple(item.cloud for item in taken.objects),
        support=None,
        view=taken.view,
        gravity=taken.gravity,
        gravity_confidence=taken.gravity_confidence,
        T_odom_camera=None if lacking == "T_odom_camera" else T,
        stamp_ns=second * 1_100_000_000,
    )


def test_a_real_run_compiles_no_kernel_that_was_not_warm() -> None:
    paths = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), str(ROOT / "test")])}
    done = subprocess.run([sys.executable, "-c", FRESH], env=paths, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    before, after = json.loads(done.stdout)
    assert before == after
    assert sum(map(len, before.values())) >= 10


def test_warming_up_stores_nothing(tmp_path: Path) -> None:
    store = tmp_path / "store.db"
    warm(RegistrarParams(store=str(store)))
    assert not store.exists()
