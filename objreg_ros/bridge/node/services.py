# SPDX-License-Identifier: Apache-2.0
"""A node whose services take long: their work is done by threads of their own, so that no subscription waits."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any

from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.task import Future
from std_srvs.srv import SetBool, Trigger

from objreg_ros.bridge.node.managed import ManagedNode

REST = 5.0  # times as long as a service worked it then rests


class ServingNode(ManagedNode):
    """A managed node with services whose work is done `aside`, and one that turns its inputs off."""

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self.is_enabled = True
        self.apart = ReentrantCallbackGroup()  # of services that wait for work that is done `aside`
        self._aside: list[threading.Thread] = []

    def is_busy(self) -> bool:
        """Whether something is done `aside`."""
        return any(thread.is_alive() for thread in self._aside)

    def aside(self, work: Callable[[], Any]) -> Future:
        """What ``work`` gives, done by a thread of its own; for a service to await, so that no subscription waits.

        The service has to be in the group ``apart``: a group does nothing else while one of its callbacks waits.
        """
        executor = self.executor
        future = Future(executor=executor)

        def run() -> None:
            try:
                future.set_result(work())
            except BaseException as error:
                if self.context.ok():  # else nobody waits for it any more
                    future.set_exception(error)
            if executor is not None:
                executor.wake()

        thread = threading.Thread(target=run, name="aside", daemon=True)
        self._aside = [*(other for other in self._aside if other.is_alive()), thread]
        thread.start()
        return future

    def serve_aside(self, name: str, work: Callable[[], tuple[bool, str]]) -> None:
        """A service of std_srvs/Trigger: ``work`` is done `aside`, and says whether it could be, and what to know.

        A call that comes while another one is answered is refused, and so is one that comes before the service has
        rested `REST` times as long as that took: whoever calls all the time holds up little of the rest.
        """
        in_hand, rested_s = threading.Lock(), 0.0

        async def answer(_: Any, response: Any) -> Any:
            nonlocal rested_s
            begun_s = time.monotonic()
            if begun_s < rested_s:
                response.success = False
                response.message = f"{name}: call again in {rested_s - begun_s:.1f} s: an earlier call is just done"
                return response
            if not in_hand.acquire(blocking=False):
                response.success, response.message = False, f"{name}: call again: an earlier call is not done yet"
                return response
            try:
                response.success, response.message = await self.aside(work)
            finally:
                rested_s = time.monotonic() + REST * (time.monotonic() - begun_s)
                in_hand.release()
            return response

        self.create_service(Trigger, name, answer, callback_group=self.apart)

    def serve_enable(self, inputs: str) -> None:
        """``~/enable`` of std_srvs/SetBool: whether ``inputs`` are used, as ``is_enabled``; a warning while not."""

        def answer(request: Any, response: Any) -> Any:
            self.is_enabled, response.success = request.data, True
            response.message = "enabled" if request.data else f"{inputs} are dropped as disabled"
            self.get_logger().warning(f"~/enable: {response.message}")
            return response

        self.create_service(SetBool, "~/enable", answer)

    def end_aside(self) -> None:
        """Wait for what is done `aside`."""
        for thread in self._aside:
            thread.join()
