# SPDX-License-Identifier: Apache-2.0
"""The life of a managed node: what it opens and takes down, what it refuses, and when it ends."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest
import rclpy
from rclpy.lifecycle import TransitionCallbackReturn
from std_msgs.msg import String

from objreg_ros.bridge.node import qos
from objreg_ros.bridge.node.node_base import NodeBase
from objreg_ros.bridge.node.params import ManagedParams, NodeBaseParams
from objreg_ros.bridge.process.intra_process import IntraProcessBus

DONE, REFUSED = TransitionCallbackReturn.SUCCESS, TransitionCallbackReturn.FAILURE


class Shop(NodeBase):
    """Opens unless it is set to fail, and records what becomes of it."""

    trouble: Exception | None = None
    at_the_end: Exception | None = None

    def __init__(self, bus: IntraProcessBus | None = None) -> None:
        self.notes: list[str] = []
        super().__init__("shop", ManagedParams, bus=bus)

    def open(self) -> None:
        self.listen(String, "bell", self.notes.append, qos.stage())
        self.create_timer(1.0, lambda: None)
        self.create_publisher(String, "sign", qos.stage())
        if self.trouble is not None:
            raise self.trouble
        self.notes.append("opened")

    def shut(self) -> None:
        super().shut()
        self.notes.append("shut")
        if self.at_the_end is not None:
            raise self.at_the_end

    def apply_parameters(self) -> None:
        self.notes.append("adopted")


@pytest.fixture
def made() -> Iterator[Callable[..., Shop]]:
    shops: list[Shop] = []

    def make(*settings: str) -> Shop:
        rclpy.init(args=["--ros-args", *(word for given in settings for word in ("-p", given))] if settings else [])
        shops.append(Shop())
        return shops[-1]

    yield make
    for shop in shops:
        shop.at_the_end = None
        shop.close()
    rclpy.try_shutdown()


@pytest.fixture
def shop(made: Callable[..., Shop]) -> Shop:
    return made("managed:=true", "autostart:=false")


def listens(shop: Shop) -> bool:
    return any(subscription.topic_name == "/bell" for subscription in shop.subscriptions)


def test_a_node_that_is_not_managed_opens_as_it_is_made_and_has_no_life_cycle(made: Callable[..., Shop]) -> None:
    shop = made()
    assert shop.notes == ["opened"] and shop.state == "active" and shop.is_active
    assert not [service for service in shop.services if "change_state" in service.srv_name]


def test_a_managed_node_is_active_from_the_start_unless_it_is_asked_to_wait(made: Callable[..., Shop]) -> None:
    shop = made("managed:=true")
    assert shop.state == "active" and shop.is_active and shop.notes == ["opened"]


def test_it_opens_when_it_is_configured_and_lets_frames_in_while_it_is_active(shop: Shop) -> None:
    assert shop.state == "unconfigured" and not listens(shop)
    assert shop.trigger_configure() == DONE and listens(shop)
    for stamp_ns, change in enumerate([None, shop.trigger_activate, shop.trigger_deactivate, shop.trigger_activate]):
        if change is not None:
            change()
        shop.accept(stamp_ns)
        assert shop.let_in(stamp_ns) == (shop.state == "active")
    balance = shop.accounting.balance()
    assert balance.dropped == {"inactive": 2} and balance.waiting == 2


def test_what_was_opened_is_taken_down_as_often_as_it_is_cleaned_up_and_the_counters_begin_anew(shop: Shop) -> None:
    before = [thing for thing, _ in shop._entities()]
    for _ in range(3):
        assert shop.trigger_configure() == DONE
        shop.accept(5)
        assert shop.trigger_cleanup() == DONE
        after = [thing for thing, _ in shop._entities()]
        assert all(a is b for a, b in zip(after, before, strict=True)) and shop.accounting.balance().received == 0
    assert shop.notes == ["opened", "shut"] * 3 and shop.state == "unconfigured"


def test_what_stands_in_the_way_leaves_nothing_behind_and_it_is_tried_again(shop: Shop) -> None:
    shop.trouble = OSError("expected a model,\n got none")
    before = len(list(shop._entities()))
    assert shop.trigger_configure() == REFUSED and shop.state == "unconfigured"
    assert len(list(shop._entities())) == before and not shop.failure.done()
    shop.trouble = None
    assert shop.trigger_configure() == DONE and shop.state == "inactive"


def test_a_bug_while_it_is_configured_ends_the_node(shop: Shop) -> None:
    shop.trouble = ZeroDivisionError("a bug")
    assert shop.trigger_configure() == REFUSED
    with pytest.raises(ZeroDivisionError):
        shop.failure.result()


def test_what_cannot_be_written_any_more_is_no_success_and_the_node_is_clean(shop: Shop) -> None:
    shop.trigger_configure()
    shop.at_the_end = OSError("disk full")
    assert shop.trigger_cleanup() != DONE and shop.state == "unconfigured" and not listens(shop)


def test_it_is_not_cleaned_up_while_a_service_is_at_work(shop: Shop, monkeypatch: pytest.MonkeyPatch) -> None:
    shop.trigger_configure()
    monkeypatch.setattr(shop, "is_busy", lambda: True)
    assert shop.trigger_cleanup() == REFUSED and shop.state == "inactive" and listens(shop)


def test_a_node_that_is_shut_down_ends_without_an_error(shop: Shop) -> None:
    assert shop.trigger_shutdown() == DONE
    assert shop.failure.done() and shop.failure.result() is None and not shop.is_active


def test_parameters_that_are_not_live_hold_from_the_next_time_that_it_is_configured(shop: Shop) -> None:
    def put(name: str, value: object) -> str:
        return shop.set_parameters([rclpy.Parameter(name, value=value)])[0].reason

    assert put("max_megapixels", 2.0) == "" and shop.trigger_configure() == DONE
    assert shop.most_pixels == 2_000_000
    assert put("max_megapixels", 3.0) == (
        "max_megapixels: expected to be changed while unconfigured; clean the node up first"
    )
    assert put("managed", False) != "" and "adopted" not in shop.notes
    assert shop.trigger_cleanup() == DONE and put("max_megapixels", 3.0) == ""
    assert shop.settings.of(NodeBaseParams).most_pixels == 3_000_000


def test_nodes_of_one_process_cannot_be_managed(made: Callable[..., Shop]) -> None:
    made("managed:=true", "autostart:=false")
    with pytest.raises(ValueError, match="managed: expected false where all nodes are in one process"):
        Shop(IntraProcessBus())
