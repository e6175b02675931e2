# SPDX-License-Identifier: Apache-2.0
"""The attacks: no spoilt message gets anything else out of a decoder than data, ValueError or OSError; and what the
attacks would see if it did."""

from __future__ import annotations

import importlib
import os
import random
import signal
import time
from pathlib import Path
from types import ModuleType

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

DECODERS = ("image", "depth", "camera_info", "points", "detections", "odom", "constraints", "frame")
EXAMPLES = 60 if os.environ.get("CI") else 200


@pytest.fixture
def messages() -> ModuleType:
    pytest.importorskip("rclpy", reason="messages are spoilt with ROS 2")
    return importlib.import_module("attacked_messages")


@pytest.fixture
def trials() -> ModuleType:
    return importlib.import_module("trials")


@pytest.mark.parametrize("name", DECODERS)
def test_no_spoilt_message_breaks_a_decoder(messages: ModuleType, trials: ModuleType, name: str) -> None:
    attempt = messages.decoder_attempt(name)

    def require_answer(draw: random.Random | int) -> None:
        kind, error = trials.judged(attempt, draw)
        if kind not in ("passed", "refused"):
            raise AssertionError(f"{name}: {kind}, {draw}") from error

    @settings(max_examples=EXAMPLES, suppress_health_check=list(HealthCheck))
    @given(draw=st.randoms(use_true_random=False))
    def attack(draw: random.Random) -> None:
        require_answer(draw)

    attack()
    for seed in range(5 * EXAMPLES):  # dice that hypothesis does not throw
        require_answer(seed)


@pytest.mark.parametrize("name", DECODERS)
def test_what_is_not_spoilt_passes(messages: ModuleType, trials: ModuleType, name: str) -> None:
    goods, use, _ = messages.DECODERS[name]
    most_pixels = 1_000_000
    for good in goods():
        if len(getattr(good[0], "data", b"")) < most_pixels and getattr(good[0], "format", "") not in ("gif", "bmp"):
            kind, error = trials.judged(lambda _, good=good: use(*good), 0)
            assert kind == "passed" or hasattr(good[0], "format"), error


def test_a_trial_is_the_same_again(messages: ModuleType) -> None:
    from rclpy.serialization import serialize_message

    def spoil(seed: int) -> list[bytes]:
        draw = random.Random(seed)
        return [serialize_message(messages.any_labels(draw)) for _ in range(20)]

    assert spoil(7) == spoil(7) != spoil(8)


def prepare_evil(_: Path):  # type: ignore[no-untyped-def]
    """Every kind of finding, each at a seed of its own."""
    from trials import WrongAnswerError

    count = iter(range(100))

    def attempt(draw: random.Random) -> None:
        state = draw.random()
        number = next(k for k in range(7) if random.Random(k).random() == state)
        next(count)
        if number == 1:
            raise TypeError("no such type")
        if number == 2:
            os.kill(os.getpid(), signal.SIGSEGV)
        if number == 3:
            while True:
                pass
        if number == 4:
            raise WrongAnswerError("seven")
        if number == 5:
            held = bytearray(60 << 20)
            held[::4096] = bytes(len(held[::4096]))
        if number == 6:
            raise MemoryError

    return attempt


def test_every_kind_of_finding_is_counted_with_its_seed_and_the_trials_go_on(
    trials: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(trials, "PATIENCE_S", 0.3)
    monkeypatch.setattr(trials, "GREED_MB", 40)
    row = trials.run_trials(trials.Target("evil", prepare_evil), float("inf"), 2, 0, 7).row()
    found = {(item["kind"], item["what"].split(":")[0], item["seeds"][0]) for item in row["findings"]}
    assert {(kind, seed) for kind, _, seed in found} == {
        ("bug", 1), ("death", 2), ("hang", 3), ("wrong", 4), ("greed", 5), ("bug", 6)
    }  # fmt: skip
    assert (row["tries"], row["refused"], row["bug"], row["death"], row["hang"]) == (7, 0, 2, 1, 1)


def test_the_time_ends_the_trials(trials: ModuleType) -> None:
    target = trials.Target("nothing", lambda _: lambda draw: time.sleep(0.001))
    row = trials.run_trials(target, 0.2, 2).row()
    assert row["tries"] > 10 and not row["findings"]


def test_an_error_of_the_attack_itself_is_not_a_refusal(trials: ModuleType) -> None:
    def attempt(_: random.Random) -> None:
        raise ValueError("not of the package")

    assert trials.judged(attempt, 0)[0] == "bug"


def test_the_time_is_divided_over_what_was_chosen() -> None:
    pytest.importorskip("rclpy", reason="messages are spoilt with ROS 2")
    attacks = importlib.import_module("attacks")
    times = attacks.seconds_of(attacks.NAMES, 100.0)
    assert sum(times.values()) == pytest.approx(100.0) and set(times) == set(attacks.NAMES)
    assert attacks.seconds_of(["store"], 5.0) == {"store": pytest.approx(5.0)}
