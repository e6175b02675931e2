# SPDX-License-Identifier: Apache-2.0
"""LIO-SAM: topic ``lio_loop/loop_closure_detection``, std_msgs/Float64MultiArray.

It takes no pose, so where the camera sits does not matter: it takes two stamps, looks up its own keyframes for them
and runs its own ICP between them.
"""

from __future__ import annotations

from typing import Any

from objreg_ros.data.closures import LoopClosure


def fill_loop(message: Any, closure: LoopClosure) -> Any:
    """The Float64MultiArray with exactly two numbers, in seconds: the later stamp, then the earlier."""
    message.data = [1e-9 * max(closure.from_ns, closure.to_ns), 1e-9 * min(closure.from_ns, closure.to_ns)]
    return message
