# SPDX-License-Identifier: Apache-2.0
"""A registrar that is ended in the middle of a search: live, in a process of its own."""

from __future__ import annotations

import signal
import sys
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from std_msgs.msg import Header

from objreg_ros import limits
from objreg_ros.data.frames import Frame
from objreg_ros.keyframes.own_size import OBJECTS
from objreg_ros.memory.store import Store

from .graph import Graph
from .test_relocalised import BESIDE, HERE, MOUNT, frame, send_frame

pytestmark = pytest.mark.ros

LONG = """
import sys, time
import rclpy
from objreg_ros.registrar import node
class Long(node.Registrar):
    def search(self, *how):
        outcome = super().search(*how)
        if outcome.keyframe_id == 2:
            print("searching", flush=True)
            while rclpy.ok():
                time.sleep(0.01)
        return outcome
node.Registrar = Long
sys.exit(node.main())
"""


@pytest.fixture
def fresh(domain: int, tmp_path: Path) -> Iterator[Graph]:
    made = Graph(domain, tmp_path)
    yield made
    made.close()


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_during_a_search_ends_with_status_0_says_nothing_and_loses_nothing(
    fresh: Graph, tmp_path: Path, how: signal.Signals
) -> None:
    store = tmp_path / "place.db"
    command = fresh.command("registrar", f"-p store:={store}", "-p reliable:=true", MOUNT)
    fresh.receive(Header, "finished")
    fresh._start("registrar", [sys.executable, "-c", LONG, *command[command.index("--ros-args") :]])
    frames = [frame(10 + 3 * k, T, T) for k, T in enumerate((HERE, BESIDE, HERE))]
    names = dict(enumerate(sorted({cloud.label for one in frames for cloud in one.objects})))
    for one in frames:
        send_frame(fresh, one, names)
        if one is not frames[-1]:  # which completes the keyframe whose search does not end
            fresh.answer("registrar", one.stamp_ns)
    fresh.wait_for(lambda: "searching" in fresh.log("registrar"), what="the search")
    before = len(fresh.log("registrar").splitlines())
    assert fresh.stop("registrar", how) == 0
    assert fresh.log("registrar").splitlines()[before:] == []
    stored = Store(store, read_only=True)
    assert len(stored.keyframe_ids()) == 3  # that in hand, and the one that no frame followed, too
    stored.close()


def test_frames_of_hundreds_of_objects_hold_up_neither_a_registrar_nor_its_end(fresh: Graph, tmp_path: Path) -> None:
    store = tmp_path / "place.db"
    fresh.receive(Header, "finished")
    fresh.start("registrar", "registrar", f"-p store:={store}", "-p reliable:=true", MOUNT)
    crowds = [crowded(10 + 3 * k, T) for k, T in enumerate((HERE, BESIDE, HERE, BESIDE))]
    for one in crowds[:3]:
        send_frame(fresh, one, {0: "cup"})
        assert fresh.answer("registrar", one.stamp_ns) == "published"
    send_frame(fresh, crowds[3], {0: "cup"})
    code = fresh.stop("registrar")
    assert code == 0, fresh.log("registrar")
    with closing(Store(store, read_only=True)) as stored:
        kept = [len(stored.keyframe(number).objects) for number in stored.keyframe_ids()]
    assert len(kept) >= 3 and set(kept) == {OBJECTS}  # of the last frame nothing is known: it may be on its way
    assert store.stat().st_size < 4 * 4_000_000


def crowded(seconds: float, T: np.ndarray) -> Frame:
    """A frame with as many objects of one label as one may have."""
    (cup, *_), random = frame(seconds, T, T).objects, np.random.default_rng(1)
    at = random.uniform((-1.0, -0.8, 1.0), (1.0, 0.8, 3.0), (limits.MOST_OBJECTS, 3))
    near = [(cup.xyz - cup.xyz.mean(axis=0) + place).astype(np.float32) for place in at]
    cups = [replace(cup, label="cup", instance=k + 1, xyz=xyz) for k, xyz in enumerate(near)]
    return replace(frame(seconds, T, T), objects=tuple(cups))
