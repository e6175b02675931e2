# SPDX-License-Identifier: Apache-2.0
"""The counters of a node as diagnostic_msgs, and back for those who read them."""

from __future__ import annotations

import json
from collections.abc import Collection, Iterable, Mapping
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from std_msgs.msg import Header

from objreg_ros.bridge.node.accounting import Balance
from objreg_ros.bridge.node.common import DROPPED, LATENCY, LOST, CommonDiagnostics
from objreg_ros.data.closures import LoopClosure, ObjectMatch, Reason, Rejected
from objreg_ros.diagnostics import Diagnostics, by_key

REJECTED = "rejected: "  # before a reason, in the status of a registrar
EVIDENCE = "evidence: "  # before the name of a number, in that of a constraint or a refusal
FROM, TO = "from [ns]", "to [ns]"


def diagnostic(
    node: str, now: Time, troubles: Collection[str], common: CommonDiagnostics, *own: Diagnostics
) -> DiagnosticArray:
    """One status: what nodes have in common and what the node adds; with ``troubles`` a warning of them."""
    status = DiagnosticStatus(
        level=DiagnosticStatus.WARN if troubles else DiagnosticStatus.OK,
        name=f"{node}: frames",
        message="; ".join(troubles) or f"{common.rate:.1f} frames/s",
        hardware_id="objreg_ros",
        values=_key_values(by_key(common, *own)),
    )
    return DiagnosticArray(header=Header(stamp=now), status=[status])


def refusals(node: str, now: Time, rejected: Iterable[Rejected]) -> DiagnosticArray:
    """A status for every refusal: the reason and its numbers, the two keyframes, and the pose that was refused."""
    return DiagnosticArray(header=Header(stamp=now), status=[_refusal(node, item) for item in rejected])


def acceptances(node: str, now: Time, closures: Iterable[LoopClosure]) -> DiagnosticArray:
    """A status for every constraint: the two keyframes, the objects that closed it, and its numbers.

    What `constraints` has no place for.
    """
    return DiagnosticArray(header=Header(stamp=now), status=[_acceptance(node, closure) for closure in closures])


def _refusal(node: str, rejected: Rejected) -> DiagnosticStatus:
    pose = None if rejected.T_from_to is None else rejected.T_from_to.tolist()
    values = {"T_from_to": json.dumps(pose)}
    return _of_keyframes(node, "refusal", f"{rejected.reason.value}: {rejected.detail}", rejected, values)


def _acceptance(node: str, closure: LoopClosure) -> DiagnosticStatus:
    values = {
        "labels": json.dumps(list(closure.labels)),
        "objects": json.dumps([[match.label, match.object_id] for match in closure.objects]),
    }
    return _of_keyframes(node, "constraint", ", ".join(dict.fromkeys(closure.labels)), closure, values)


def _of_keyframes(
    node: str, what: str, message: str, outcome: LoopClosure | Rejected, values: Mapping[str, str]
) -> DiagnosticStatus:
    """The status of an outcome: its keyframes, ``values``, and the numbers behind it."""
    evidence = {f"{EVIDENCE}{name}": repr(float(number)) for name, number in outcome.evidence.items()}
    known = {FROM: outcome.from_ns, TO: outcome.to_ns, **values, **evidence}
    return DiagnosticStatus(
        level=DiagnosticStatus.OK,
        name=f"{node}: {what}",
        message=message,
        hardware_id="objreg_ros",
        values=_key_values(known),
    )


def refusal_of(status: DiagnosticStatus) -> Rejected:
    """The refusal in a status of `refusals`."""
    values = {pair.key: pair.value for pair in status.values}
    reason, _, detail = status.message.partition(": ")
    pose = json.loads(values["T_from_to"])
    return Rejected(
        reason=Reason(reason),
        from_ns=int(values[FROM]),
        to_ns=int(values[TO]),
        detail=detail,
        T_from_to=None if pose is None else np.array(pose),
        evidence=_evidence_of(values),
    )


def accepted_of(status: DiagnosticStatus) -> tuple[tuple[int, int], dict[str, Any]]:
    """The stamps in ns of both keyframes in a status of `acceptances`, and fields of their `LoopClosure`."""
    values = {pair.key: pair.value for pair in status.values}
    objects = (ObjectMatch(label=label, object_id=int(number)) for label, number in json.loads(values["objects"]))
    fields = {
        "labels": tuple(map(str, json.loads(values["labels"]))),
        "objects": tuple(objects),
        "evidence": _evidence_of(values),
    }
    return (int(values[FROM]), int(values[TO])), fields


def _evidence_of(values: Mapping[str, str]) -> dict[str, float]:
    return {key.removeprefix(EVIDENCE): float(value) for key, value in values.items() if key.startswith(EVIDENCE)}


def _key_values(values: Mapping[str, object]) -> list[KeyValue]:
    return [KeyValue(key=key, value=str(value)) for key, value in values.items()]


def balance_of(status: DiagnosticStatus) -> Balance:
    """The counters in a status of `diagnostic`."""
    values = {pair.key: pair.value for pair in status.values}
    stages = sorted({key.split(" ")[1] for key in values if key.startswith(LATENCY)})
    return Balance(
        received=int(values["received"]),
        published=int(values["published"]),
        waiting=int(values["waiting"]),
        dropped=_counts_of(values, DROPPED),
        lost=_counts_of(values, LOST),
        stage_ms={
            stage: (float(values[f"{LATENCY}{stage} p50 [ms]"]), float(values[f"{LATENCY}{stage} p95 [ms]"]))
            for stage in stages
        },
    )


def _counts_of(values: Mapping[str, str], prefix: str) -> dict[str, int]:
    return {key.removeprefix(prefix): int(value) for key, value in values.items() if key.startswith(prefix)}
