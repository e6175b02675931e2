# SPDX-License-Identifier: Apache-2.0
"""``objreg_to_lio_sam``: pairs of stamps for LIO-SAM, at the pace at which it takes them.

LIO-SAM drops pairs of less than 30 s and all but the last five that it has not looked at, and looks at one a second;
its subscription keeps one and is best effort. So what is too near is dropped here, and the others go one a period.
"""

from __future__ import annotations

import sys

from std_msgs.msg import Float64MultiArray

from objreg_mapper.adapters.adapter import Adapter, seconds
from objreg_mapper.adapters.params import ToLioSamParams
from objreg_mapper.formats.lio_sam import fill_loop
from objreg_ros.bridge.node import qos
from objreg_ros.bridge.node.node_base import DroppedError
from objreg_ros.bridge.node.spin import run
from objreg_ros.data.closures import LoopClosure

TOPIC = "lio_loop/loop_closure_detection"


class ToLioSam(Adapter):
    """Sends LIO-SAM which of its keyframes to register."""

    def __init__(self) -> None:
        super().__init__("objreg_to_lio_sam", ToLioSamParams)
        self._rate = self.settings.of(ToLioSamParams)
        self._sent_at = -float("inf")
        self._loops = self.create_publisher(Float64MultiArray, TOPIC, qos.stage())
        self.get_logger().info(
            f"pairs nearer than {self._rate.least_seconds:g} s are dropped, for LIO-SAM does; of others one goes every "
            f"{self._rate.period:g} s, for LIO-SAM keeps five and drops older ones"
        )
        self.listen_for_closures()

    def hand_over(self, closure: LoopClosure) -> bool:
        """Publish it, if LIO-SAM listens and is through with the last; `DroppedError` for a pair that is too near."""
        apart_s = 1e-9 * abs(closure.to_ns - closure.from_ns)
        if apart_s < self._rate.least_seconds:
            text = f"expected keyframes at least {self._rate.least_seconds:g} s apart, got {apart_s:.3f} s"
            raise DroppedError("too_near", text)
        if not self._loops.get_subscription_count() or seconds() - self._sent_at < self._rate.period:
            return False
        self._sent_at = seconds()
        self._loops.publish(fill_loop(Float64MultiArray(), closure))
        return True


def main() -> int:
    """The executable ``objreg_to_lio_sam``."""
    return run(ToLioSam)


if __name__ == "__main__":
    sys.exit(main())
