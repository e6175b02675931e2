# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import pytest
from rclpy.context import Context
from rclpy.node import Node
from std_msgs.msg import String

from objreg_tools.cli.watching.listening import careful, listening


def make(context: Context, name: str = "listener") -> Node:
    return Node(name, context=context, start_parameter_services=False)


@pytest.fixture(autouse=True)
def local(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")


def test_a_node_listens_within_the_block_and_its_context_ends_with_it() -> None:
    with listening(make) as executor:
        (node,) = executor.get_nodes()
        context = node.context
        assert context.ok() and node.get_name() == "listener"
    assert not context.ok()


def test_names_that_ros_does_not_take_are_refused_with_what_was_given() -> None:
    refused = listening(
        lambda context: Node("listener", namespace="a robot", context=context), ["-r", "__ns:=/a robot"]
    )
    with pytest.raises(ValueError, match="expected names that ROS takes, got -r __ns:=/a robot"), refused:
        pass


@pytest.mark.parametrize("error", [ValueError("no number"), KeyError("received"), TypeError("text")])
def test_a_message_that_breaks_its_contract_is_passed_over(error: Exception) -> None:
    def take(_: String) -> None:
        raise error

    with listening(make) as executor:
        (node,) = executor.get_nodes()
        careful(node, take)(String())
