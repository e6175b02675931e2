# SPDX-License-Identifier: Apache-2.0
"""The judge of each attacked thing: what is sound passes, and a fault that was planted in the product is seen."""

from __future__ import annotations

import importlib
import json
import random
import socket
import struct
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import click
import numpy as np
import pytest


@pytest.fixture(autouse=True)
def _ros() -> None:
    pytest.importorskip("rclpy", reason="the attacks use messages of ROS 2")


def script(name: str) -> ModuleType:
    return importlib.import_module(name)


def found(attempt: Callable[[random.Random], None], seeds: range = range(60)) -> set[str]:
    """What the trials of some seeds come to."""
    judged = script("trials").judged
    return {judged(attempt, seed)[0] for seed in seeds}


def first(attempt: Callable[[random.Random], None], kind: str, seeds: range = range(400)) -> Exception:
    """The first finding of a kind."""
    judged = script("trials").judged
    outcomes = (judged(attempt, seed) for seed in seeds)
    error = next((error for came, error in outcomes if came == kind), None)
    assert error is not None, f"no {kind} in {len(seeds)} trials"
    return error


# ---------------------------------------------------------------------------------------------------------------- fence


def write_aside(folder: Path) -> Callable[[random.Random], None]:
    def attempt(draw: random.Random) -> None:
        (folder / "own").write_text("inside")
        if draw.random() == random.Random(1).random():
            (folder.parent / "beside").write_text("outside")

    return attempt


def test_a_file_written_beside_the_folder_of_a_trial_is_counted_as_outside() -> None:
    trials = script("trials")
    row = trials.run_trials(trials.Target("aside", write_aside), float("inf"), 1, 0, 3).row()
    assert (row["outside"], row["findings"][0]["seeds"]) == (1, [1])
    assert row["findings"][0]["what"].endswith("/beside")


@pytest.mark.parametrize(
    ("event", "args", "paths"),
    [
        ("open", ("/x/a", "w", 0o101), ["/x/a"]),
        ("open", ("/x/a", "r", 0), []),
        ("open", (3, "w", 0o101), []),
        ("os.rename", ("/x/a", "/x/b", -1, -1), ["/x/a", "/x/b"]),
        ("os.remove", ("a", 7), ["/proc/self/fd/7/a"]),
        ("sqlite3.connect", ("file:/x/a?mode=ro",), []),
        ("sqlite3.connect", ("/x/a",), ["/x/a"]),
        ("shutil.rmtree", ("/x", None), ["/x"]),
    ],
)
def test_the_fence_knows_what_an_event_writes(event: str, args: tuple[Any, ...], paths: list[str]) -> None:
    assert list(script("fence")._written(event, args)) == paths


# ---------------------------------------------------------------------------------------------------------------- peers


def test_forged_keyframes_are_refused_or_sound(tmp_path: Path) -> None:
    assert found(script("attacked_peers").keyframe_attempt(tmp_path)) == {"passed", "refused"}


@pytest.mark.parametrize("what", ["nan", "size"])
def test_a_keyframe_that_comes_in_unsound_is_seen(what: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    peers = script("attacked_peers")
    good = peers.unpack_keyframe

    def careless(packed: bytes) -> Any:
        keyframe = good(packed)
        if what == "size":
            return replace(keyframe, view=SimpleNamespace(xyz=np.zeros((2000, 2000, 3))))
        return replace(keyframe, context=SimpleNamespace(xyz=np.full((1, 3), np.nan), normals=np.zeros((1, 3))))

    monkeypatch.setattr(peers, "unpack_keyframe", careless)
    error = first(peers.keyframe_attempt(tmp_path), "wrong")
    assert ("no number" if what == "nan" else "pixels") in str(error)


class Careless:
    """An exchange that a hostile peer can silence, by one kind of fault."""

    def __init__(self, exchange: Any, fault: str) -> None:
        self._exchange, self._fault, self._hostile = exchange, fault, 0
        self.run = exchange.run

    def __getattr__(self, name: str) -> Any:
        return getattr(self._exchange, name)

    def receive_summary(self, packed: bytes, now: float) -> Any:
        """As the one before; after four others it listens to nobody."""
        self._hostile += 1
        return None if self._fault == "summaries" and self._hostile > 4 else self._exchange.receive_summary(packed, now)

    def awaits(self, packed: bytes) -> bool:
        """As the one before; after three others nothing is waited for."""
        self._hostile += 1
        return not (self._fault == "deliveries" and self._hostile > 4) and self._exchange.awaits(packed)

    def answer(self, now: float) -> Any:
        """Nothing, where requests are lost."""
        return None if self._fault == "requests" else self._exchange.answer(now)


@pytest.mark.parametrize(
    ("kind", "fault", "finding"),
    [
        (b"OXS", "summaries", "an honest summary is not asked for"),
        (b"OXD", "deliveries", "an honest keyframe that was asked for is not taken"),
        (b"OXR", "requests", "an honest request is not answered"),
    ],
)
def test_an_exchange_that_can_be_silenced_is_seen_and_ours_is_not(
    kind: bytes, fault: str, finding: str, tmp_path: Path
) -> None:
    peers = script("attacked_peers")
    assert found(peers.exchange_attempt(kind, tmp_path)) == {"passed"}
    careless = peers.exchange_attempt(kind, tmp_path, lambda side: Careless(side.exchange(), fault))
    assert finding in str(first(careless, "wrong"))


# -------------------------------------------------------------------------------------------------------------- results


def test_edited_results_are_refused_or_used(tmp_path: Path) -> None:
    pytest.importorskip("pyarrow")
    assert found(script("attacked_results").result_attempt(tmp_path), range(150)) == {"passed", "refused"}


def test_a_schema_that_lets_anything_in_is_seen(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    pytest.importorskip("pyarrow")
    from objreg_tools.cli.many import batch_work

    monkeypatch.setattr(batch_work, "require_result", lambda summary: None)
    assert first(script("attacked_results").result_attempt(tmp_path), "bug")


def test_damaged_maps_are_refused_or_the_same(tmp_path: Path) -> None:
    assert found(script("attacked_results").saved_map_attempt(tmp_path)) == {"passed", "refused"}


def test_a_map_that_loads_as_another_is_seen(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    results = script("attacked_results")
    attempt = results.saved_map_attempt(tmp_path)
    load = results.saved.load

    def careless(path: Path, params: Any) -> Any:
        graph = load(path, params)
        if path.name == "again.npz":
            graph.withdraw(lambda closure: True)
        return graph

    monkeypatch.setattr(results.saved, "load", careless)
    assert "another one once it was saved" in str(first(attempt, "wrong"))


# ------------------------------------------------------------------------------------------------------------- commands


def test_outputs_stay_apart_from_inputs(tmp_path: Path) -> None:
    attempt = script("attacked_commands").outputs_attempt(tmp_path)
    assert found(attempt, range(100)) == {"passed", "refused"}


def test_a_command_that_writes_over_what_it_reads_is_seen_and_that_is_restored(tmp_path: Path) -> None:
    commands = script("attacked_commands")

    class Unguarded(click.Group):
        """Every command writes into whatever follows its last option."""

        def invoke(self, context: click.Context) -> None:
            """Write."""
            Path(self.arguments[-1]).write_text("overwritten")

        def parse_args(self, context: click.Context, args: list[str]) -> list[str]:
            """Take any arguments."""
            self.arguments = list(args)
            return []

    attempt = commands.outputs_attempt(tmp_path, Unguarded())
    whole = commands.contents(tmp_path / "inputs")
    assert "was written over" in str(first(attempt, "outside"))
    assert commands.contents(tmp_path / "inputs") == whole


def test_a_hostile_server_gets_nothing_past_the_download(tmp_path: Path) -> None:
    assert found(script("attacked_commands").download_attempt(tmp_path), range(12)) <= {"passed", "refused"}


def test_a_download_that_never_ends_and_one_that_is_not_checked_are_seen(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    commands = script("attacked_commands")
    dripping = commands.download_attempt(tmp_path, (commands._drip,))
    monkeypatch.setattr(commands, "PATIENCE_S", 0.0)  # whatever it takes is too long
    assert "takes" in str(first(dripping, "hang", range(5)))
    place = tmp_path / "place"
    place.mkdir()
    (place / "some.onnx").write_bytes(b"not what was asked for")
    with pytest.raises(script("trials").WrongAnswerError, match="has not the checksum"):
        commands.require_kept(place, "0" * 64)


def test_the_server_of_the_attacks_answers(tmp_path: Path) -> None:
    commands = script("attacked_commands")
    server = commands.Hostile(random.Random(0), (commands._babble,))
    host, port = server.url.removeprefix("http://").split(":")
    with socket.create_connection((host, int(port)), 5.0) as connection:
        connection.sendall(b"GET / HTTP/1.1\r\n\r\n")
        connection.settimeout(5.0)
        connection.recv(100)
    server.close()


# ---------------------------------------------------------------------------------------------------------------- calls


def value(**fields: Any) -> Any:
    from rcl_interfaces.msg import ParameterValue

    return ParameterValue(**fields)


@pytest.mark.parametrize(
    ("wanted", "successful", "reason", "old", "new", "fault"),
    [
        (2, True, "", 1, 2, ""),
        (2, False, "too large", 1, 1, ""),
        (2, False, "", 1, 1, "refused without a reason"),
        (2, False, "too large", 1, 2, "refused, and changed all the same"),
        (2, True, "", 1, 1, "accepted, and is not what was set"),
    ],
)
def test_an_answer_about_a_parameter_that_is_not_true_is_seen(
    wanted: int, successful: bool, reason: str, old: int, new: int, fault: str
) -> None:
    calls = script("attacked_calls")
    values = [value(type=2, integer_value=number) for number in (wanted, old, new)]
    result = SimpleNamespace(successful=successful, reason=reason)
    assert calls.fault_of(values[0], result, *values[1:]) == fault


def test_a_whole_number_and_an_empty_list_are_what_was_set() -> None:
    calls, done = script("attacked_calls"), SimpleNamespace(successful=True, reason="")
    real, none = value(type=3, double_value=1.0), value(type=9)
    assert not calls.fault_of(value(type=2, integer_value=1), done, real, real)
    assert not calls.fault_of(value(type=6), done, none, none)
    assert calls.fault_of(value(type=2, integer_value=2), done, real, real)


def besieged(calls: ModuleType, kind: str, folder: Path, **more: Any) -> Any:
    """A siege without its node."""
    siege: Any = object.__new__(getattr(calls, kind))
    siege.tally, siege.name, siege._home = script("trials").Tally(), "registrar", calls._home(folder)
    siege._before, siege._stored, siege._last_line = calls.contents(siege._home), 4, lambda: ""
    siege.__dict__.update(more)
    return siege


def test_a_file_of_the_home_folder_and_a_store_that_is_emptied_are_seen(tmp_path: Path) -> None:
    siege = besieged(script("attacked_calls"), "Services", tmp_path, stored=lambda: 4)
    siege.require_kept(1)
    assert not siege.tally.findings
    (siege._home / "precious.npz").write_text("a map")
    siege.require_kept(2)
    siege.stored = lambda: 0
    siege.require_kept(3)
    assert [(row["kind"], row["seeds"]) for row in siege.tally.findings.values()] == [("outside", [2]), ("wrong", [3])]


@pytest.mark.parametrize(("answers", "kinds"), [(False, ["hang"]), (True, [])])
def test_a_service_that_does_not_answer_is_seen(
    answers: bool, kinds: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls = script("attacked_calls")
    monkeypatch.setattr(calls, "ANSWER_S", 0.1)
    answer = SimpleNamespace(done=lambda: answers, result=lambda: "yes")
    client = SimpleNamespace(call_async=lambda request: answer)
    executor = SimpleNamespace(spin_once=lambda timeout_sec: None)
    siege = besieged(calls, "Services", tmp_path, graph=SimpleNamespace(executor=executor))
    siege.client, siege._alive = lambda kind, name: client, lambda: True
    assert siege.call(SimpleNamespace(Request=dict), "save", 5) == ("yes" if answers else None)
    assert [row["kind"] for row in siege.tally.findings.values()] == kinds


class Remembers(SimpleNamespace):
    """A node's parameters, as services: ``stuck`` says that it sets what it leaves as it is."""

    def call(self, kind: Any, name: str, seed: int = -1, **asked: Any) -> Any:
        """Answer."""
        if name == "get_parameters":
            return SimpleNamespace(values=[value(type=2, integer_value=self.at)] * len(asked["names"]))
        if not self.stuck:
            self.at = asked["parameters"][-1].value.integer_value
        done = SimpleNamespace(successful=True, reason="")
        return SimpleNamespace(result=done, results=[done] * len(asked["parameters"]))


@pytest.mark.parametrize("stuck", [False, True])
def test_a_parameter_that_is_not_set_though_it_is_said_to_be_is_seen(stuck: bool, tmp_path: Path) -> None:
    from rcl_interfaces.msg import Parameter

    siege = besieged(script("attacked_calls"), "Parameters", tmp_path, call=Remembers(stuck=stuck, at=1).call)
    siege._set(0, [Parameter(name="candidates", value=value(type=2, integer_value=7))], False)
    assert siege.tally.counts["wrong"] == stuck and siege.tally.tries == 1


def test_extremes_of_every_type_can_be_sent(tmp_path: Path) -> None:
    from rcl_interfaces.msg import ParameterDescriptor
    from rclpy.serialization import serialize_message

    calls = script("attacked_calls")
    siege, draw = besieged(calls, "Parameters", tmp_path), random.Random(0)
    kinds = set()
    for kind in list(calls.FIELDS) * 8:
        made = siege.extreme(draw, ParameterDescriptor(type=kind))
        kinds.add(made.type)
        assert len(serialize_message(made)) < 3 * calls.MOST_BYTES
    assert kinds == set(calls.FIELDS)


# --------------------------------------------------------------------------------------------------------- hostile peer


def test_the_ratio_is_of_the_constraints_and_is_not_taken_of_none() -> None:
    hostile = script("hostile_peer")
    assert hostile.ratio_of({"constraints": 10}, {"constraints": 9}) == pytest.approx(0.9)
    with pytest.raises(click.ClickException, match="expected constraints without a hostile peer"):
        hostile.ratio_of({"constraints": 0}, {"constraints": 9})


def test_a_forged_message_has_a_right_checksum_most_often(tmp_path: Path) -> None:
    peers = script("attacked_peers")
    good = peers.pack_request(peers.Request(peers.Name("a", 1), 1.0, "b"))
    kind, draw = peers.KINDS[peers.REQUEST], random.Random(0)
    made = [peers.forged(draw, kind, good, b"") for _ in range(200)]
    right = [m for m in made if len(m) > 12 and struct.unpack_from("<I", m, 4)[0] == peers.zlib.crc32(m[8:])]
    assert len(set(made)) > 100 and len(right) > 150


def test_an_edit_changes_something_and_is_the_same_again() -> None:
    edits, value = script("edits"), {"a": [1, 2.5, {"b": None}], "c": "text"}
    whole = json.dumps(value)
    made = [edits.edited_text(random.Random(seed), value) for seed in range(100)]
    assert made == [edits.edited_text(random.Random(seed), value) for seed in range(100)]
    assert sum(one != whole for one in made) > 90 and json.dumps(value) == whole
