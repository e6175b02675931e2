# SPDX-License-Identifier: Apache-2.0
"""A node whose services take long: their work is done by threads of their own, so that no subscription waits."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from typing import Any

from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.task import Future
from std_srvs.srv import SetBool, Trigger

from objreg_ros.bridge.messages import headers
from objreg_ros.bridge.node.managed import ManagedNode

try:
    from objreg_msgs.srv import Veto
except ImportError:  # optional: without a retraction no consumer could withdraw a closure
    Veto = None

MOST_VETOES = 1000  # ids of one call
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
        """A service of std_srvs/Trigger: ``work`` is done as by `serve_requests`."""
        self.serve_requests(Trigger, name, lambda _: work())

    def serve_requests(self, kind: Any, name: str, work: Callable[[Any], tuple[bool, str]]) -> None:
        """A service whose answer is success and message: ``work`` is done `aside` with the request, and gives both.

        A call that comes while another one is answered is refused, and so is one that comes before the service has
        rested `REST` times as long as that took: whoever calls all the time holds up little of the rest.
        """
        in_hand, rested_s = threading.Lock(), 0.0

        async def answer(request: Any, response: Any) -> Any:
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
                response.success, response.message = await self.aside(lambda: work(request))
            finally:
                rested_s = time.monotonic() + REST * (time.monotonic() - begun_s)
                in_hand.release()
            return response

        self.create_service(kind, name, answer, callback_group=self.apart)

    def serve_vetoes(self, change: Callable[[Sequence[str], bool], tuple[bool, str]]) -> None:
        """``~/veto`` where objreg_msgs is installed: ``change`` is called with ids and whether it is undone.

        It says whether that is done, and what to know, as in `serve_requests`.
        """

        def answer(request: Any) -> tuple[bool, str]:
            if len(request.ids) > MOST_VETOES:
                return False, f"ids: expected at most {MOST_VETOES}, got {len(request.ids)}"
            try:
                ids = [headers.bounded(name, "id") for name in request.ids]
            except ValueError as error:
                return False, str(error)
            return change(ids, bool(request.undo))

        if Veto is not None:
            self.serve_requests(Veto, "~/veto", answer)

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
