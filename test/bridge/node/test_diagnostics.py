# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticStatus

from objreg_ros.bridge.node.accounting import Balance
from objreg_ros.bridge.node.common import CommonDiagnostics
from objreg_ros.bridge.node.diagnostics import acceptances, accepted_of, balance_of, diagnostic, refusal_of, refusals
from objreg_ros.data.closures import LoopClosure, ObjectMatch, Reason, Rejected
from objreg_ros.diagnostics import Diagnostics, reading

BALANCE = Balance(
    received=10,
    published=6,
    waiting=1,
    dropped={"overtaken": 2, "malformed_image": 1},
    lost={"image": 3},
    stage_ms={"detect": (8.25, 9.5), "total": (10.0, 20.0)},
)


@dataclass(frozen=True, kw_only=True)
class Own(Diagnostics):
    keyframes: int = reading("stored keyframes", "How many are stored.")


def status(*troubles: str) -> DiagnosticStatus:
    return diagnostic(
        "/detector", Time(sec=4), troubles, CommonDiagnostics.of(BALANCE, 29.97), Own(keyframes=7)
    ).status[0]


def test_the_counters_come_back_from_their_message() -> None:
    assert balance_of(status()) == BALANCE


def test_what_a_node_adds_is_shown() -> None:
    values = {pair.key: pair.value for pair in status().values}
    assert values["stored keyframes"] == "7" and values["rate [Hz]"] == "29.97"


def test_what_is_wrong_makes_a_warning_that_names_all_of_it() -> None:
    assert status().level == DiagnosticStatus.OK and status().message == "30.0 frames/s"
    warned = status("nothing on /image for 5 s", "odom: everything was dropped")
    assert warned.level == DiagnosticStatus.WARN
    assert warned.message == "nothing on /image for 5 s; odom: everything was dropped"


def test_a_refusal_comes_back_with_its_reason_its_numbers_and_its_pose() -> None:
    turned_down = Rejected(reason=Reason.SLACK, from_ns=5, to_ns=2**61, detail="sigma 0.1 m: no", T_from_to=np.eye(4))
    untried = Rejected(reason=Reason.NO_CANDIDATE, from_ns=7, to_ns=7, detail="none of 3")
    message = refusals("/registrar", Time(sec=4), [turned_down, untried])
    assert message.status[0].message == "slides_along_a_plane: sigma 0.1 m: no"
    first, second = map(refusal_of, message.status)
    assert (first.reason, first.from_ns, first.to_ns, first.detail) == (Reason.SLACK, 5, 2**61, "sigma 0.1 m: no")
    assert np.array_equal(first.T_from_to, np.eye(4)) and second.T_from_to is None


def test_the_numbers_of_a_refusal_and_the_objects_of_a_constraint_come_back_as_they_were() -> None:
    numbers = {"score": 0.1 + 0.2, "moved cup [m]": 1e-9}
    refused = Rejected(reason=Reason.SLACK, from_ns=5, to_ns=6, detail="no", evidence=numbers)
    assert refusal_of(refusals("/registrar", Time(), [refused]).status[0]).evidence == numbers
    cup = ObjectMatch(label="cup", object_id=4)
    closure = LoopClosure(
        from_ns=5, to_ns=2**61, T_from_to=np.eye(4), covariance=np.eye(6), labels=("cup", "cup"), objects=(cup,),
        evidence=numbers,
    )  # fmt: skip
    (sent,) = acceptances("/registrar", Time(sec=4), [closure]).status
    assert (sent.name, sent.message) == ("/registrar: constraint", "cup")
    stamps_ns, known = accepted_of(sent)
    assert stamps_ns == (5, 2**61) and known["labels"] == ("cup", "cup") and known["evidence"] == numbers
    assert [(match.label, match.object_id) for match in known["objects"]] == [("cup", 4)]
