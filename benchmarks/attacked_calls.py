# SPDX-License-Identifier: Apache-2.0
"""Services of live nodes under attack: parameters at extremes, and calls in floods.

Every node runs in a process and a namespace of its own, with a home folder that holds files of its user. Calls are
answered within `PATIENCE_S`. What is refused has a reason and changes nothing. No file of the user's is written, and no
store is emptied. Once parameters are as they were, and inputs enabled, a good frame comes through.
"""

from __future__ import annotations

import os
import random
import sys
import time
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

import attacked_messages as good
from attacked_commands import contents
from attacked_nodes import PACE_S, SHARES, SIEGES, Siege
from mutation import FLOATS, INTS, STRINGS
from rcl_interfaces.msg import Parameter as ParameterMsg
from rcl_interfaces.msg import ParameterDescriptor, ParameterType, ParameterValue
from rcl_interfaces.srv import DescribeParameters, GetParameters, ListParameters, SetParameters, SetParametersAtomically
from std_srvs.srv import SetBool, Trigger
from trials import PATIENCE_S

from objreg_ros.memory.store import Store

CALLS = 12  # of one batch that sets parameters, each of a few
FLOOD = 80  # calls at once
MANY = 100_000  # items of a list
MOST_BYTES = 4_000_000  # of one
ANSWER_S = 30.0
FIELDS = {
    ParameterType.PARAMETER_BOOL: "bool_value", ParameterType.PARAMETER_INTEGER: "integer_value",
    ParameterType.PARAMETER_DOUBLE: "double_value", ParameterType.PARAMETER_STRING: "string_value",
    ParameterType.PARAMETER_BOOL_ARRAY: "bool_array_value",
    ParameterType.PARAMETER_INTEGER_ARRAY: "integer_array_value",
    ParameterType.PARAMETER_DOUBLE_ARRAY: "double_array_value",
    ParameterType.PARAMETER_STRING_ARRAY: "string_array_value", ParameterType.PARAMETER_BYTE_ARRAY: "byte_array_value",
}  # fmt: skip


class Called(Siege):
    """A node whose services are called, with a home folder to be left alone."""

    DOMAIN = 60

    def __init__(self, stage: str, folder: Path) -> None:
        self._home, self._clients = _home(folder), dict[str, Any]()
        super().__init__(stage, folder)

    def options(self) -> Sequence[str]:
        """Where it may write."""
        own = {"mapper": ["-p graph_path:={}/map.g2o"], "registrar": ["-p store:={}/place.db"]}.get(self.name, [])
        kept = self.folder / "kept"
        kept.mkdir(exist_ok=True)
        return [option.format(kept) for option in own]

    def _start(self) -> None:
        environment = {**self.graph.environment(), "HOME": str(self._home), "ROS_LOG_DIR": str(self.folder / "logs")}
        self.graph.environment = lambda: environment
        super()._start()
        self._before, self._stored = contents(self._home), self.stored()
        self.describe()

    def stored(self) -> int:
        """Keyframes in the store's file."""
        path = self.folder / "kept" / "place.db"
        if not path.exists():
            return 0
        with closing(Store(path, read_only=True)) as store:
            return store.counts()["keyframes"]

    def describe(self) -> None:
        """Ask for all parameters, as any peer may."""
        names = self.call(ListParameters, "list_parameters").result.names
        described = self.call(DescribeParameters, "describe_parameters", names=names).descriptors
        self.described = [one for one in described if not one.read_only]
        self.names = [one.name for one in self.described]
        self.values = self.call(GetParameters, "get_parameters", names=self.names).values

    def client(self, kind: Any, name: str) -> Any:
        """A client of one of the node's services."""
        if name not in self._clients:
            self._clients[name] = self.graph.node.create_client(kind, f"/{self.name}/{name}")
            self.graph.wait_for(self._clients[name].service_is_ready, ANSWER_S, name)
        return self._clients[name]

    def call(self, kind: Any, name: str, seed: int = -1, **fields: Any) -> Any:
        """The answer of a service; None, and a finding, where none comes in time."""
        answer, began = self.client(kind, name).call_async(kind.Request(**fields)), time.monotonic()
        self.settle_all([answer])
        if not answer.done() and self._alive():
            self.tally.find(seed, "hang", f"no answer of ~/{name} within {ANSWER_S:.0f} s", self._last_line())
            return None
        if (spent := time.monotonic() - began) > PATIENCE_S and seed >= 0:
            self.tally.find(seed, "hang", f"an answer of ~/{name}: after {spent:.0f} s", "")
        return answer.result() if answer.done() else None

    def settle_all(self, answers: Sequence[Any], seconds: float | None = None) -> None:
        """Wait until all have come, for a time, while the node lives."""
        until = time.monotonic() + (ANSWER_S if seconds is None else seconds)
        while not all(one.done() for one in answers) and time.monotonic() < until and self._alive():
            self.graph.executor.spin_once(timeout_sec=PACE_S)

    def show_good(self) -> None:
        """Publish a good frame, whatever becomes of it."""
        self._now_ns += good.SECOND // 10
        for topic, message in self.inputs.frame(self._now_ns).items():
            self._publish(topic, message)

    def require_kept(self, seed: int) -> None:
        """A finding where a file of the user's was changed, or the store was emptied."""
        now, self._before = contents(self._home), self._before
        changed = [path for path in now.keys() | self._before.keys() if now.get(path) != self._before.get(path)]
        if changed:
            self.tally.find(seed, "outside", f"{changed[0].relative_to(self._home)} was written or removed", "")
            self._before = now
        stored, self._stored = self.stored(), self._stored
        if 2 * stored < self._stored:  # views of one place that say the same go by themselves
            self.tally.find(seed, "wrong", f"the store has {stored} keyframes, and had {self._stored}", "")
        self._stored = stored


class Parameters(Called):
    """Parameters are set to extremes, among good frames."""

    DOMAIN = 66

    def _attack(self, draw: random.Random, seed: int) -> None:
        for _ in range(CALLS):
            chosen = draw.sample(range(len(self.names)), min(draw.choice((1, 1, 1, 2, 5)), len(self.names)))
            wanted = [ParameterMsg(name=self.names[k], value=self.extreme(draw, self.described[k])) for k in chosen]
            self._set(seed, wanted, draw.random() < 0.5)
            self.show_good()
            if not self._alive():
                return
        self._restore(seed)
        self.require_kept(seed)

    def _set(self, seed: int, wanted: list[ParameterMsg], at_once: bool) -> None:
        """Set some, and see that each is what the answer says."""
        names = [one.name for one in wanted]
        before = self.call(GetParameters, "get_parameters", seed, names=names)
        kind, service = (
            (SetParametersAtomically, "set_parameters_atomically") if at_once else (SetParameters, "set_parameters")
        )
        answer = self.call(kind, service, seed, parameters=wanted)
        after = self.call(GetParameters, "get_parameters", seed, names=names)
        self.tally.tries += len(wanted)
        if None in (before, answer, after):
            return
        results = [answer.result] * len(wanted) if at_once else answer.results
        for one, result, old, new in zip(wanted, results, before.values, after.values, strict=True):
            self.tally.refused += not result.successful
            if fault := fault_of(one.value, result, old, new):
                self.tally.find(seed, "wrong", f"{fault}: {one.name}", "")

    def _restore(self, seed: int) -> None:
        wanted = [ParameterMsg(name=name, value=value) for name, value in zip(self.names, self.values, strict=True)]
        kept = [one for one in wanted if one.value.type]
        answer = self.call(SetParametersAtomically, "set_parameters_atomically", seed, parameters=kept)
        if answer is not None and not answer.result.successful:
            self.tally.find(seed, "wrong", f"the values of the start are refused: {answer.result.reason}", "")

    def extreme(self, draw: random.Random, about: ParameterDescriptor) -> ParameterValue:
        """A value at the bounds of a parameter, beyond them, or of another type."""
        kind = about.type if draw.random() < 0.85 and about.type in FIELDS else draw.choice(list(FIELDS))
        made, field = ParameterValue(type=kind), FIELDS[kind]
        bounds = [x for r in (*about.floating_point_range, *about.integer_range) for x in (r.from_value, r.to_value)]
        if not field.endswith("array_value"):
            setattr(made, field, self._one(draw, kind, bounds))
        elif kind != ParameterType.PARAMETER_BYTE_ARRAY:
            count = draw.choice((0, 1, 3, 16, MANY if draw.random() < 0.1 else 2))
            one = ParameterType.PARAMETER_BOOL + kind - ParameterType.PARAMETER_BOOL_ARRAY
            items = [self._one(draw, one, bounds) for _ in range(min(count, 16))]
            fit = MOST_BYTES // max(
                sum(len(str(item)) for item in items), 1
            )  # the transport unpacks before a node looks
            setattr(made, field, items * min(count // 16, fit) if count > 16 else items)
        return made

    def _one(self, draw: random.Random, kind: int, bounds: Sequence[float]) -> Any:
        if kind == ParameterType.PARAMETER_BOOL:
            return draw.random() < 0.5
        if kind == ParameterType.PARAMETER_INTEGER:
            numbers = [int(bound) + step for bound in bounds if abs(bound) < 2**62 for step in (-1, 0, 1)]
            return draw.choice((*INTS, *numbers, *numbers))
        if kind == ParameterType.PARAMETER_DOUBLE:
            near = [bound * scale for bound in bounds for scale in (1.0, 1.0 + 1e-9, 1.0 - 1e-9)]
            return float(draw.choice((*FLOATS, sys.float_info.min, sys.float_info.max, *near, *near)))
        baits = [str(path) for path in self._before] + [
            str(self._home / name) for name in ("new.g2o", "no/new", "pipe")
        ]
        return draw.choice((*(text for text in STRINGS if "\0" not in text), *baits))


def fault_of(wanted: ParameterValue, result: Any, old: ParameterValue, new: ParameterValue) -> str:
    """What is not true of an answer to a setting; empty where all is."""
    if not result.successful and not result.reason:
        return "refused without a reason"
    if not result.successful and not _same(old, new):
        return "refused, and changed all the same"
    if result.successful and not _same(wanted, new) and not _is_whole(wanted, new):
        return "accepted, and is not what was set"
    return ""


def _same(one: ParameterValue, other: ParameterValue) -> bool:
    return one.type == other.type and repr(getattr(one, FIELDS.get(one.type, "type"))) == repr(
        getattr(other, FIELDS.get(other.type, "type"))
    )


def _is_whole(wanted: ParameterValue, new: ParameterValue) -> bool:
    """1 is accepted for 1.0, and an empty list for one of any type."""
    if new.type == ParameterType.PARAMETER_DOUBLE and wanted.type == ParameterType.PARAMETER_INTEGER:
        return float(wanted.integer_value) == new.double_value
    items = [getattr(one, FIELDS.get(one.type, "type")) for one in (wanted, new)]
    return all(hasattr(one, "__len__") and not isinstance(one, str) for one in items) and [*items[0]] == [*items[1]]


class Services(Called):
    """All services that take no more than a yes or no are called in floods, with questions among them."""

    DOMAIN = 72

    def _attack(self, draw: random.Random, seed: int) -> None:
        services = self._offered()
        answers = [self._send(draw, services) for _ in range(FLOOD)]
        for _ in range(3):
            self.show_good()
            self.graph.executor.spin_once(timeout_sec=PACE_S)
        self.tally.tries += len(answers)
        self.settle_all(answers, PATIENCE_S)  # those beyond the depth of a queue have no answer
        self.tally.refused += sum(one.done() and getattr(one.result(), "success", True) is False for one in answers)
        if self._alive():
            if "enable" in services:
                self.call(SetBool, "enable", seed, data=True)
            self.call(GetParameters, "get_parameters", seed, names=self.names[:1])
            self.require_kept(seed)

    def _offered(self) -> dict[str, Any]:
        """The services of the node, by name, as the graph of ROS has them."""
        kinds = {"std_srvs/srv/Trigger": Trigger, "std_srvs/srv/SetBool": SetBool}
        asked = {"get_parameters": GetParameters, "list_parameters": ListParameters}
        found = self.graph.node.get_service_names_and_types_by_node(self.name, "/")
        return asked | {name.rpartition("/")[2]: kinds[kind] for name, (kind, *_) in found if kind in kinds}

    def _send(self, draw: random.Random, services: dict[str, Any]) -> Any:
        """One call, whose answer is not waited for."""
        name = draw.choice(list(services))
        kind, fields = services[name], dict[str, Any]()
        if kind is SetBool:
            fields = {"data": draw.random() < 0.5}
        elif kind is GetParameters:
            fields = {"names": [draw.choice(("", "x" * 10_000, *self.names))] * draw.choice((0, 1, 1000))}
        elif kind is ListParameters:
            fields = {"prefixes": [draw.choice(("", ".", "x" * 1000))] * draw.choice((0, 1, 100)), "depth": 0}
        return self.client(kind, name).call_async(kind.Request(**fields))


def _home(folder: Path) -> Path:
    """A folder with files of a user in it, and a pipe."""
    home = folder / "home"
    home.mkdir()
    for name in ("precious.npz", "precious.g2o", "precious.db", ".bashrc"):
        (home / name).write_text("precious")
    os.mkfifo(home / "pipe")
    return home


SIEGES |= {"parameters": Parameters, "services": Services}
TARGETS = {f"{kind} {stage}": 0.5 * share for kind in ("parameters", "services") for stage, share in SHARES.items()}
