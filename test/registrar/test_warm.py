# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from pathlib import Path

from objreg_ros.registrar import consensus, features, tracking, visibility
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registrar.warm import warm

ENTERED = (
    consensus._consistent_pairs,
    consensus._supported_poses,
    features._cells,
    features._histograms,
    tracking._normal_equations,
    visibility.count,
)


def test_every_kernel_is_compiled_before_the_first_frame_and_nothing_is_stored(tmp_path: Path) -> None:
    store = tmp_path / "store.db"
    warm(RegistrarParams(store=str(store)))
    assert all(kernel.signatures for kernel in ENTERED) and not store.exists()
