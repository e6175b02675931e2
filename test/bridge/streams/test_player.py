# SPDX-License-Identifier: Apache-2.0
"""What a player publishes, when, and what it waits for; the graph are nodes of this process."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from functools import partial

import pytest
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.serialization import serialize_message
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Image
from std_msgs.msg import Header, String

from objreg_ros.bridge.messages import headers, to_msg
from objreg_ros.bridge.node import qos
from objreg_ros.bridge.streams import player as player_module
from objreg_ros.bridge.streams.acknowledgements import IMAGE, Acknowledgements
from objreg_ros.bridge.streams.player import PlayedMessage, Player, message_type

PATIENCE = 20.0  # seconds; a test that gets there has failed
STRING, PICTURE = "std_msgs/msg/String", "sensor_msgs/msg/Image"


def until(true: Callable[[], bool]) -> None:
    """Wait until something is true; a test that waits for too long goes on and fails."""
    deadline = time.monotonic() + PATIENCE
    while not true() and time.monotonic() < deadline:
        time.sleep(0.005)


class Graph:
    """Nodes of this process, spun in a thread of their own, and what they received."""

    def __init__(self) -> None:
        self.executor = SingleThreadedExecutor()
        self.nodes: dict[str, Node] = {}
        self.received: list[object] = []
        self.thread = threading.Thread(target=self.spin)
        self.going = True
        self.thread.start()

    def spin(self) -> None:
        while self.going:
            self.executor.spin_once(timeout_sec=0.02)

    def node(self, name: str) -> Node:
        if name not in self.nodes:
            self.nodes[name] = Node(name)
            self.executor.add_node(self.nodes[name])
        return self.nodes[name]

    def receive(self, kind: type, topic: str, take: Callable[[object], object]) -> None:
        self.node("listener").create_subscription(kind, topic, lambda m: self.received.append(take(m)), qos.stage(100))

    def wait_for(self, count: int) -> list[object]:
        until(lambda: len(self.received) >= count)
        return self.received

    def detector(self, answers: bool = True) -> Publisher:
        """A node that acknowledgements every image as soon as it comes, or not at all."""
        node = self.node("detector")
        finished = node.create_publisher(Header, "finished", qos.stage(100))

        def answer(message: Image) -> None:
            self.received.append(headers.stamp_ns(message))
            if answers:
                finished.publish(to_msg.finished("detector", headers.stamp_ns(message)))

        node.create_subscription(Image, "image", answer, qos.stage(100))
        return finished

    def close(self) -> None:
        self.going = False
        self.thread.join()
        self.executor.shutdown()
        for node in self.nodes.values():
            node.destroy_node()


@pytest.fixture
def graph(monkeypatch: pytest.MonkeyPatch) -> Iterator[Graph]:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    monkeypatch.setattr(player_module, "SETTLE_S", 0.0)
    rclpy.init(args=[])
    made = Graph()
    yield made
    made.close()
    rclpy.try_shutdown()


@pytest.fixture
def player(graph: Graph) -> Iterator[Player]:
    made = Player({"texts": STRING, "image": PICTURE}, clock=True)
    yield made
    made.close()


def text_message(text: str, stamp_ns: int = 0) -> PlayedMessage:
    return PlayedMessage("texts", stamp_ns, serialize_message(String(data=text)))


def picture(stamp_ns: int) -> PlayedMessage:
    return PlayedMessage(
        "image", stamp_ns, serialize_message(Image(header=to_msg.header(stamp_ns, "c"))), IMAGE, stamp_ns
    )


def test_items_are_published_in_their_order_counted_and_reported(graph: Graph, player: Player) -> None:
    graph.receive(String, "texts", lambda m: m.data)
    assert player.wait_for_listeners(["texts"], PATIENCE) == []
    reported: list[PlayedMessage] = []
    items = [text_message(text) for text in "abc"]
    player.play(items, None, reported.append)
    assert graph.wait_for(3) == ["a", "b", "c"] and reported == items and player.published == {"texts": 3}


def test_a_topic_without_listeners_is_named_and_the_others_are_not(graph: Graph, player: Player) -> None:
    graph.receive(String, "texts", lambda m: m.data)
    player.wait_for_listeners(["texts"], PATIENCE)
    assert player.wait_for_listeners(["texts", "image"], 0.05) == ["/image"]


@pytest.mark.parametrize(("rate", "gap", "least"), [(1.0, 0.2, 0.4), (4.0, 0.2, 0.1), (40.0, 60.0, 3.0)])
def test_items_keep_their_own_intervals_divided_by_the_rate(
    player: Player, rate: float, gap: float, least: float
) -> None:
    moments: list[float] = []
    items = [text_message("a", 5 * 10**9 + round(k * gap * 1e9)) for k in range(3)]
    player.play(items, rate, lambda _: moments.append(time.monotonic()))
    first, middle, last = moments
    assert last - first >= least - 0.005 and middle - first >= least / 2 - 0.005
    assert last - first < 20 * max(1.0, least)


def test_without_a_rate_nothing_is_waited_for(player: Player) -> None:
    start = time.monotonic()
    player.play([text_message("a", k * 60 * 10**9) for k in range(3)], None, lambda _: None)
    assert time.monotonic() - start < 60.0


def test_the_clock_shows_when_an_item_was_recorded(graph: Graph, player: Player) -> None:
    graph.receive(Clock, "/clock", lambda m: headers.stamp_ns(m.clock))
    (ticks,) = (publisher for publisher in player.publishers if publisher.topic_name == "/clock")
    until(lambda: ticks.get_subscription_count() == 1)
    player.play(
        [text_message("a", 1_700_000_000_000_000_001), text_message("b", 1_700_000_000_000_000_009)],
        None,
        lambda _: None,
    )
    assert graph.wait_for(2) == [1_700_000_000_000_000_001, 1_700_000_000_000_000_009]


def test_without_a_clock_the_time_is_left_alone(graph: Graph) -> None:
    player = Player({"texts": STRING})
    player.play([text_message("a")], None, lambda _: None)
    assert player.count_publishers("/clock") == 0
    player.close()


def followed(graph: Graph, player: Player, finished: Publisher) -> Acknowledgements:
    """The acknowledgements of the detector, once both sides are connected."""
    until(lambda: player.count_publishers("finished") == 1)
    acknowledgements = player.subscribe_to_acknowledgements(0.0)
    until(lambda: finished.get_subscription_count() == 1)
    assert player.wait_for_listeners(["image"], PATIENCE) == []
    return acknowledgements


def test_a_lossless_play_has_one_image_on_its_way_at_a_time(graph: Graph, player: Player) -> None:
    acknowledgements = followed(graph, player, graph.detector())
    ahead: list[int] = []
    player.play_lossless(map(picture, range(1, 6)), PATIENCE, lambda _: ahead.append(acknowledgements.waiting(IMAGE)))
    assert ahead == [1] * 5 and graph.received == [1, 2, 3, 4, 5]
    assert acknowledgements.outcomes == {"detector": {"published": 5}} and player.lost == []


def test_where_the_graph_is_silent_a_second_image_goes_and_what_never_ends_is_lost(
    graph: Graph, player: Player, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(player_module, "SILENCE_S", (0.05, 99.0))
    acknowledgements = followed(graph, player, graph.detector(answers=False))
    ahead: list[int] = []
    player.play_lossless(map(picture, (1, 2, 3)), 0.2, lambda _: ahead.append(acknowledgements.waiting(IMAGE)))
    assert ahead == [1, 2, 1] and player.lost == [1, 2, 3]


def test_a_node_that_ends_during_a_lossless_play_is_named(
    graph: Graph, player: Player, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(player_module, "ASK_AGAIN_S", 0.0)
    finished = graph.detector(answers=False)
    followed(graph, player, finished)
    end = partial(graph.node("detector").destroy_publisher, finished)
    with pytest.raises(ValueError, match="lossless: detector has ended and takes no more frames; see its log"):
        player.play_lossless([picture(1)], PATIENCE, lambda _: end())


def test_a_lossless_play_without_nodes_is_refused(player: Player) -> None:
    with pytest.raises(ValueError, match="expected the nodes to publish `finished`, got none"):
        player.subscribe_to_acknowledgements(0.0)


def test_a_node_that_does_not_receive_its_inputs_is_named(
    graph: Graph, player: Player, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(player_module, "START_S", 0.1)
    graph.node("segmenter").create_publisher(Header, "finished", qos.stage())
    graph.node("segmenter").create_subscription(String, "labels", print, qos.stage())
    until(lambda: player.count_publishers("finished") == player.count_subscribers("labels") == 1)
    with pytest.raises(ValueError, match=r"expected listening nodes, got none on detections_table$"):
        player.subscribe_to_acknowledgements(0.0)


def test_a_lossless_play_without_acknowledgements_is_refused(player: Player) -> None:
    with pytest.raises(ValueError, match="expected subscribe_to_acknowledgements before a lossless play"):
        player.play_lossless([], 1.0, print)


def test_who_comes_late_still_gets_what_was_latched(graph: Graph) -> None:
    player = Player({"texts": STRING, "static": STRING}, latched={"static"})
    try:
        for topic in ("texts", "static"):
            player.play([PlayedMessage(topic, 0, serialize_message(String(data=topic)))], None, print)
        received: list[str] = []
        for topic in ("texts", "static"):
            player.create_subscription(String, topic, lambda m: received.append(m.data), qos.latched(5))
            player.create_subscription(String, topic, lambda m: received.append(m.data), qos.stage())
        deadline = time.monotonic() + 60.0
        while not received and time.monotonic() < deadline:
            rclpy.spin_once(player, timeout_sec=0.05)
        for _ in range(10):
            rclpy.spin_once(player, timeout_sec=0.02)
        assert received == ["static"]
    finally:
        player.close()


def test_a_type_is_found_by_its_name() -> None:
    assert message_type(PICTURE) is Image and message_type("sensor_msgs/Image") is Image


def test_no_type_at_all_is_refused() -> None:
    with pytest.raises(ValueError, match="no type: expected an installed message type"):
        message_type("")


@pytest.mark.parametrize("kind", ["nowhere_msgs/msg/Image", "sensor_msgs/msg/Picture", "Image"])
def test_a_type_that_is_not_installed_is_refused_by_its_name(kind: str) -> None:
    with pytest.raises(ValueError, match=f"{kind}: expected an installed message type, got none; leave its topic out"):
        message_type(kind)
