# SPDX-License-Identifier: Apache-2.0
"""A node that opens as it is made, or, where it is managed, when its life cycle says so.

The states are those of ROS's managed nodes. Parameters can be changed while it is unconfigured; to be configured is to
open; only an active node lets frames in.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from rclpy.lifecycle import LifecycleState, TransitionCallbackReturn
from rclpy.lifecycle.node import LifecycleNodeMixin
from rclpy.task import Future

from objreg_ros.bridge.node.overridable import OverridableNode
from objreg_ros.bridge.node.params import ManagedParams
from objreg_ros.bridge.process.lifetime import settle

DONE, REFUSED, BROKEN = (
    TransitionCallbackReturn.SUCCESS,
    TransitionCallbackReturn.FAILURE,
    TransitionCallbackReturn.ERROR,
)


class ManagedNode(LifecycleNodeMixin, OverridableNode):
    """A node with a life cycle if it is managed; without one, and without its services, if not."""

    def __init__(self, name: str) -> None:
        OverridableNode.__init__(self, name)
        self.is_open, self.is_active, self.is_managed = False, True, False
        self.failure: Future = Future()  # done when the node is to end: with what broke it, or with None
        self._lasting: list[Any] = []  # what the node keeps while it is closed

    # What a subclass fills in

    def prepare(self) -> None:
        """Empty counters; at the start, and whenever the node is configured or was cleaned up."""

    def open(self) -> None:
        """Load what the node needs, publish and subscribe. If it fails: ValueError or OSError, and nothing is held."""

    def shut(self) -> None:
        """End the work and let go of what `open` took, but for what ROS knows of."""

    def end_work(self) -> None:
        """End what `prepare` began; not for the first time perhaps."""

    def is_busy(self) -> bool:
        """Whether a service still has to answer, so that the node cannot be cleaned up now."""
        return False

    # Life

    def begin_life(self, params: ManagedParams) -> None:
        """Open now, as `open` says; if managed begin as unconfigured, and with autostart try to become active."""
        self.is_managed, self.is_active = params.managed, not params.managed
        if self.is_managed:
            LifecycleNodeMixin.__init__(self)
        self._lasting = [entity for entity, _ in self._entities()]
        self.prepare()
        if not self.is_managed:
            self.open()
            self.is_open = True
        elif params.autostart and self.trigger_configure() == DONE:
            self.trigger_activate()

    @property
    def state(self) -> str:
        """Where the node is in its life cycle; active if it is not managed."""
        return str(self._state_machine.current_state[1]) if self.is_managed else "active"

    def fail(self, error: BaseException) -> None:
        """Something met a bug: end the node with it. What fails because ROS is already down is not one."""
        if self.context.ok():
            self.failure.set_exception(error)

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Open; where that is refused the log has the reason in one line, and parameters can be put right."""
        self._clear()
        try:
            self.open()
        except (ValueError, OSError) as error:
            self._clear()
            self.get_logger().error(f"not configured: {' '.join(str(error).split())}")
            return REFUSED
        except Exception as error:  # rclpy would say nothing of it
            self.fail(error)
            return REFUSED
        self.is_open = True
        settle()
        return DONE

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Let frames in."""
        self.is_active = True
        return DONE

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Drop the frames that come from now on; what is in hand goes on, and what is known stays."""
        self.is_active = False
        return DONE

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Shut, and forget; what could not be written any more is said."""
        if self.is_busy():
            self.get_logger().error("not cleaned up: expected no service at work, got one that has yet to answer")
            return REFUSED
        self.is_open, done = False, DONE
        try:
            self.shut()
        except (ValueError, OSError) as error:
            self.get_logger().error(f"its last work is lost: {' '.join(str(error).split())}")
            done = BROKEN
        self._clear()
        return done

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Let the process end once it has answered, as a signal would."""
        self.is_active = False
        if not self.failure.done():
            self.failure.set_result(None)
        return DONE

    def _clear(self) -> None:
        """Take down all that was made since the life began, and begin the counters anew."""
        for entity, destroy in list(self._entities()):
            if not any(entity is lasting for lasting in self._lasting):
                destroy(entity)
        self.end_work()
        self.prepare()

    def _entities(self) -> Iterator[tuple[Any, Callable[[Any], object]]]:
        """All that ROS knows of this node, each with what takes it down."""
        kinds: tuple[tuple[Iterator[Any], Callable[[Any], object]], ...] = (
            (self.publishers, self.destroy_publisher),
            (self.subscriptions, self.destroy_subscription),
            (self.clients, self.destroy_client),
            (self.services, self.destroy_service),
            (self.timers, self.destroy_timer),
            (self.guards, self.destroy_guard_condition),
        )
        return ((entity, destroy) for entities, destroy in kinds for entity in entities)
