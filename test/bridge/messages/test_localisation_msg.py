# SPDX-License-Identifier: Apache-2.0
"""The state of the localisation as a message, and as a value of diagnostics."""

from __future__ import annotations

import math
import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from objreg_ros.bridge.messages import localisation_msg
from objreg_ros.bridge.messages.closures_msg import closure_id
from objreg_ros.data.closures import LoopClosure
from objreg_ros.data.localisation import LocalisationState, State

CLOSURE = LoopClosure(from_ns=5, to_ns=9, T_from_to=np.eye(4), covariance=np.eye(6), labels=("cup",), to_session=1)
NOW = LocalisationState(
    stamp_ns=3_000_000_007,
    state=State.LOST,
    reason="elsewhere",
    age_s=2.0,
    odds=0.5,
    probability=0.3,
    sigma_m=0.1,
    closure=CLOSURE,
)


def test_the_message_has_every_field(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(localisation_msg, "LocalisationStateMsg", SimpleNamespace)
    message = localisation_msg.localisation_state(NOW, "eye", "robot1")
    assert (message.header.stamp.sec, message.header.stamp.nanosec, message.header.frame_id) == (3, 7, "eye")
    assert (message.state, message.reason, message.closure_age) == (4, "elsewhere", 2.0)
    assert (message.odds, message.probability, message.sigma) == (0.5, 0.3, 0.1)
    assert message.closure_id == closure_id(CLOSURE, "robot1")


def test_the_message_file_has_these_fields_and_the_states_of_the_code(
    repository: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = (repository / "objreg_msgs/msg/LocalisationState.msg").read_text(encoding="utf-8")
    assert dict(re.findall(r"^uint8 (\w+)=(\d)", text, re.M)) == {one.name: str(int(one)) for one in State}
    monkeypatch.setattr(localisation_msg, "LocalisationStateMsg", SimpleNamespace)
    fields = re.findall(r"^[\w/]+ (\w+)$", text, re.M)
    assert fields == ["header", "state", "reason", "closure_age", "closure_id", "odds", "probability", "sigma"]
    assert set(vars(localisation_msg.localisation_state(NOW, "eye"))) == set(fields)


def test_without_objreg_msgs_there_is_no_message(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(localisation_msg, "LocalisationStateMsg", None)
    assert localisation_msg.localisation_state(NOW, "eye") is None


def test_diagnostics_say_the_state_and_why_and_nothing_before_the_first_frame() -> None:
    assert localisation_msg.summary_of(NOW) == "LOST: elsewhere"
    assert localisation_msg.summary_of(None) == ""


def test_odds_and_probabilities_are_numbers_of_their_kind() -> None:
    with pytest.raises(ValueError, match="odds of 0 or more"):
        LocalisationState(
            stamp_ns=0, state=State.SURE, reason="", age_s=0.0, odds=-1.0, probability=math.nan, sigma_m=math.nan
        )
