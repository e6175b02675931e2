# SPDX-License-Identifier: Apache-2.0
"""What a keyframer runs is compiled before the first frame comes."""

from __future__ import annotations

import subprocess
import sys

CODE = """
from numba.core.dispatcher import Dispatcher
import gc
from objreg_ros.keyframes import keyframer, fusion, warm
from objreg_ros.keyframes.params import KeyframeParams

def compiled():
    kernels = (d for d in gc.get_objects() if isinstance(d, Dispatcher))
    return {(d.py_func.__module__, d.py_func.__name__): len(d.signatures) for d in kernels}

warm.warm(KeyframeParams())
before = compiled()
made = keyframer.Keyframer(KeyframeParams())
windows = [made.add_frame(warm.drawn(k * 500_000_000)) for k in range(4)] + [made.finish_window()]
for window in windows:
    if window is not None:
        fusion.fuse(window, KeyframeParams())
after = compiled()
print(sum(before.values()) > 0, {name for name in after if after[name] != before.get(name, 0)})
"""


def test_a_run_compiles_no_kernel_that_was_not_warm() -> None:
    said = subprocess.run([sys.executable, "-c", CODE], capture_output=True, text=True, check=True)
    assert said.stdout.strip() == "True set()"
