# SPDX-License-Identifier: Apache-2.0
"""The judge of each attacked thing: what is sound passes, and a fault that was planted in the product is seen."""

from __future__ import annotations

import importlib
import random
import socket
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import click
import numpy as np
import pytest

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


@pytest.fixture(scope="module")
def _warm() -> None:
    from objreg_ros.registrar.warm import warm
    from objreg_ros.registration.params import RegistrarParams

    warm(RegistrarParams(threads=1))


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

    def hear(self, packed: bytes, now: float) -> Any:
        """As the one before; after four others it listens to nobody."""
        self._hostile += 1
        return None if self._fault == "summaries" and self._hostile > 4 else self._exchange.hear(packed, now)

    def awaits(self, packed: bytes) -> bool:
        """As the one before; after three others nothing is waited for."""
        self._hostile += 1
        return not (self._fault == "deliveries" and self._hostile > 4) and self._exchange.awaits(packed)

    def answer(self, now: float) -> Any:
        """Nothing, where requests are lost."""
        return None if self._fault == "requests" else self._exchange.answer(now)


@pytest.mark.parametrize(
    ("kind", "fault", "words"),
    [
        (b"OXS", "summaries", "an honest summary is not asked for"),
        (b"OXD", "deliveries", "an honest keyframe that was asked for is not taken"),
        (b"OXR", "requests", "an honest request is not answered"),
    ],
)
def test_an_exchange_that_can_be_silenced_is_seen_and_ours_is_not(
    kind: bytes, fault: str, words: str, tmp_path: Path
) -> None:
    peers = script("attacked_peers")
    assert found(peers.exchange_attempt(kind, tmp_path)) == {"passed"}
    careless = peers.exchange_attempt(kind, tmp_path, lambda side: Careless(side.exchange(), fault))
    assert words in str(first(careless, "wrong"))


# -------------------------------------------------------------------------------------------------------------- results


def test_edited_results_are_refused_or_used(tmp_path: Path) -> None:
    pytest.importorskip("pyarrow")
    assert found(script("attacked_results").result_attempt(tmp_path), range(150)) == {"passed", "refused"}


def test_a_schema_that_lets_anything_in_is_seen(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    pytest.importorskip("pyarrow")
    from objreg_ros.cli import batch_work

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
            Path(context.protected_args[-1] if False else self.words[-1]).write_text("overwritten")

        def parse_args(self, context: click.Context, args: list[str]) -> list[str]:
            """Take any words."""
            self.words = list(args)
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
    monkeypatch.setattr(commands, "PATIENCE_S", 0.1)
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
