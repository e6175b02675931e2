# SPDX-License-Identifier: Apache-2.0
"""How sure the registrar is of where its camera is, as the message of objreg_msgs."""

from __future__ import annotations

from typing import Any

from objreg_ros.bridge.messages import to_msg
from objreg_ros.bridge.messages.closures_msg import closure_id
from objreg_ros.data.localisation import LocalisationState

try:
    from objreg_msgs.msg import LocalisationState as LocalisationStateMsg
except ImportError:  # optional: a key of /diagnostics says it as well
    LocalisationStateMsg = None


def localisation_state(now: LocalisationState, frame_id: str, robot: str = "") -> Any:
    """An objreg_msgs/LocalisationState of the camera ``frame_id``; None where objreg_msgs is not installed."""
    if LocalisationStateMsg is None:
        return None
    return LocalisationStateMsg(
        header=to_msg.header(now.stamp_ns, frame_id),
        state=int(now.state),
        reason=now.reason,
        closure_age=now.age_s,
        closure_id="" if now.closure is None else closure_id(now.closure, robot),
        odds=now.odds,
        probability=now.probability,
        sigma=now.sigma_m,
    )


def summary_of(now: LocalisationState | None) -> str:
    """The value of the key of /diagnostics; empty before the first frame."""
    return "" if now is None else f"{now.state.name}: {now.reason}"
