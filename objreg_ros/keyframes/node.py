# SPDX-License-Identifier: Apache-2.0
"""The node of the keyframer: objects, views, gravity and odometry in; packed keyframes out, for a registrar."""

from __future__ import annotations

import math
import sys
import threading
import time
import uuid

from rclpy.clock import Clock, ClockType
from sensor_msgs.msg import CompressedImage

from objreg_ros.bridge.messages.keyframes_msg import SentKeyframe, keyframe
from objreg_ros.bridge.node import qos
from objreg_ros.bridge.node.params import ManagedParams
from objreg_ros.bridge.node.spin import run
from objreg_ros.bridge.node.worker import Backlog, Limit
from objreg_ros.bridge.process.intra_process import IntraProcessBus
from objreg_ros.bridge.streams.frames_in import FramesNode
from objreg_ros.bridge.streams.key import read_key
from objreg_ros.bridge.streams.params import KeyParams
from objreg_ros.bridge.streams.sync import Match
from objreg_ros.diagnostics import Diagnostics
from objreg_ros.keyframes.diagnostics import KeyframerDiagnostics
from objreg_ros.keyframes.frame_window import FrameWindow
from objreg_ros.keyframes.fusion import fuse
from objreg_ros.keyframes.keyframer import SILENCE_S, Keyframer
from objreg_ros.keyframes.params import KeyframeParams, KeyframerNodeParams
from objreg_ros.memory.compact import pack_keyframe

LOOK_S = 1.0  # between two looks at whether frames still come
WAITING = Limit(8, 200_000_000, math.inf)  # keyframes that wait to be fused and packed


class KeyframerNode(FramesNode):
    """Follows every frame of one camera, and sends the keyframes that come of them.

    A frame that completes a keyframe counts as waiting until that was sent. What was sent is kept for who was away.
    """

    def __init__(self, bus: IntraProcessBus | None = None) -> None:
        kinds = KeyframeParams, KeyframerNodeParams, KeyParams, ManagedParams
        super().__init__("keyframer", *kinds, bus=bus)

    def open(self) -> None:
        """Publish and listen."""
        inputs, self._key = self.settings.of(KeyframerNodeParams), read_key(self.settings.of(KeyParams).key_file)
        self._run = uuid.uuid4().hex
        self._keyframer = Keyframer(self.settings.of(KeyframeParams))
        self._tracking = threading.Lock()
        self._seen_s = math.inf  # when the last frame was followed, by `time.monotonic`
        self._sent, self._sent_bytes = 0, 0
        self._keyframes = self.create_publisher(CompressedImage, "keyframes", qos.latched(qos.KEPT_KEYFRAMES))
        self._sender: Backlog[tuple[int, FrameWindow]] = Backlog(
            self._send, self._send, self.fail, WAITING, lambda job: job[1].nbytes
        )
        self.create_timer(LOOK_S, self._end_what_rests, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self.listen_to_frames(inputs.mounting, inputs.odom_slop)

    def apply_parameters(self) -> None:
        """Live parameters hold from the next frame on."""
        self._keyframer.params = self.settings.of(KeyframeParams)

    def compute(self, stamp_ns: int, payload: Match) -> bool:
        """Follow one frame; what becomes a keyframe goes on to be sent."""
        frame, _ = self.frame_of(payload)
        with self._tracking, self.accounting.timed("track"):
            window = self._keyframer.add_frame(frame)
            self._seen_s = time.monotonic()
        if window is not None:
            self.hand_on(stamp_ns)
            self._sender.put((stamp_ns, window))
        return window is None

    def _end_what_rests(self) -> None:
        """Send the keyframe in hand once no frame came for a while: none that follows ends it."""
        with self._tracking:
            if time.monotonic() - self._seen_s < SILENCE_S:
                return
            self._seen_s, window = math.inf, self._keyframer.finish_window()
        if window is not None:
            stamp_ns = window.frames[-1].stamp_ns
            self.accept(stamp_ns)
            self._sender.put((stamp_ns, window))

    def _send(self, job: tuple[int, FrameWindow]) -> None:
        stamp_ns, window = job
        self.conclude(stamp_ns, lambda: self._publish(window))

    def _publish(self, window: FrameWindow) -> bool:
        with self.accounting.timed("pack"):
            made = fuse(window, self.settings.of(KeyframeParams))
            packed = pack_keyframe(made, 1000 * self.settings.of(KeyframerNodeParams).kilobytes)
        if made.objects and self.context.ok():
            clock = window.clock
            sent = SentKeyframe(made.stamp_ns, made.frame_id, self._run, clock.began_ns, clock.session, packed)
            self._keyframes.publish(self._key.sign(self._keyframes.topic_name, keyframe(sent)))
            self._sent, self._sent_bytes = self._sent + 1, self._sent_bytes + len(packed)
        return True

    def own_diagnostics(self) -> tuple[Diagnostics, ...]:
        """How many keyframes were sent, and how large they are."""
        own = KeyframerDiagnostics(
            sent=self._sent,
            mean_kilobytes=1e-3 * self._sent_bytes / self._sent if self._sent else None,
            without_odometry=self.without_odometry,
        )
        return (*super().own_diagnostics(), own)

    def shut(self) -> None:
        """Send what is left, unless a signal has ended ROS before, and end both workers."""
        self.end_aside()
        self.end_work()
        self._sender.drain()
        self._sender.close()
        window = self._keyframer.finish_window()
        if window is not None:
            self._publish(window)


def main() -> int:
    """The executable ``keyframer``."""
    return run(KeyframerNode)


if __name__ == "__main__":
    sys.exit(main())
