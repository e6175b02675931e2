# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import ClassVar

import pytest
import rclpy
from rcl_interfaces.msg import ParameterType
from rclpy.parameter import Parameter

from objreg_ros.bridge.node.node_base import NodeBase
from objreg_ros.params import Params, param


@dataclass(frozen=True)
class PotParams(Params):
    """Of every kind."""

    DROPPED: ClassVar[dict[str, str]] = {"lid": "it is fixed now: LID_M in pot.py"}

    threshold: float = param(0.5, "least score", "1", ge=0.0, le=1.0, live=True)
    count: int = param(3, "how many", ge=1)
    method: str = param("fast", "how", choices=("fast", "paper"), live=True)
    names: tuple[str, ...] = param((), "which", live=True)
    offsets: tuple[float, ...] = param((), "where", live=True)
    fruits: tuple[str, ...] = param(("apple",), "which are eaten")
    on: bool = param(True, "whether")


Made = Callable[..., NodeBase]


@pytest.fixture
def made() -> Iterator[Made]:
    context_args: list[NodeBase] = []

    def make(*overrides: str) -> NodeBase:
        arguments = [word for override in overrides for word in ("-p", override)]
        rclpy.init(args=["--ros-args", *arguments] if arguments else [])
        context_args.append(NodeBase("pot", PotParams))
        return context_args[-1]

    yield make
    for node in context_args:
        node.close()
    rclpy.try_shutdown()


def set_one(node: NodeBase, name: str, value: object, kind: Parameter.Type | None = None) -> str:
    result = node.set_parameters_atomically([Parameter(name, kind, value)])
    return "" if result.successful else result.reason


def test_what_is_declared_are_the_defaults(made: Made) -> None:
    assert made().settings.of(PotParams) == PotParams()


def test_a_description_a_range_and_read_only_reach_ros(made: Made) -> None:
    node = made()
    threshold, count = node.describe_parameters(["threshold", "count"])
    assert threshold.description == "least score [1]" and not threshold.read_only and count.read_only
    assert threshold.floating_point_range[0].to_value == 1.0 and count.integer_range[0].from_value == 1
    assert node.describe_parameter("method").additional_constraints == "fast | paper"


def test_an_empty_list_keeps_its_declared_type(made: Made) -> None:
    names, offsets = made().describe_parameters(["names", "offsets"])
    assert names.type == ParameterType.PARAMETER_STRING_ARRAY
    assert offsets.type == ParameterType.PARAMETER_DOUBLE_ARRAY


def test_a_list_can_be_emptied_at_the_start(made: Made) -> None:
    node = made("fruits:=[]", "names:=[]")
    assert (node.settings.of(PotParams).fruits, node.settings.of(PotParams).names) == ((), ())
    assert node.describe_parameter("fruits").type == ParameterType.PARAMETER_STRING_ARRAY


def test_start_values_are_taken_and_a_float_accepts_1(made: Made) -> None:
    node = made("threshold:=1", "names:=[cup, tv]", "offsets:=[1, 2]")
    assert node.settings.of(PotParams) == PotParams(threshold=1.0, names=("cup", "tv"), offsets=(1.0, 2.0))
    assert node.get_parameter("threshold").type_ is Parameter.Type.DOUBLE


@pytest.mark.parametrize(
    ("override", "values"),
    [("threshold:=7.0", {"threshold": 7.0}), ("count:=0", {"count": 0}), ("method:=slow", {"method": "slow"})],
)
def test_a_start_value_is_refused_as_params_refuse_it(made: Made, override: str, values: dict[str, object]) -> None:
    with pytest.raises(ValueError) as expected:
        PotParams().replaced(**values)
    with pytest.raises(ValueError) as got:
        made(override)
    assert str(got.value) == f"pot: {expected.value}"


def test_a_start_value_that_only_the_last_release_had_is_refused_with_what_took_its_place(made: Made) -> None:
    with pytest.raises(ValueError, match=r"^pot: lid: no parameter any more; it is fixed now: LID_M in pot\.py$"):
        made("lid:=0.3", "count:=4")


def test_a_start_value_that_nobody_asked_for_is_warned_of(made: Made, capfd: pytest.CaptureFixture[str]) -> None:
    made("treshold:=0.4", "zoom:=2", "count:=4", "use_sim_time:=false", "qos_overrides./a.publisher.depth:=3")
    first, second = [line for line in capfd.readouterr().err.splitlines() if "WARN" in line]
    assert "parameter treshold is ignored: this node has none of that name; did you mean threshold?" in first
    assert "parameter zoom is ignored" in second
    assert "see `objreg params`" in second or "see `ros2 param list /pot`" in second


def test_a_live_change_is_taken_and_reported(made: Made) -> None:
    node, reported = made(), []
    node.settings.changed = lambda: reported.append(node.settings.of(PotParams))
    assert set_one(node, "threshold", 1) == "" and set_one(node, "offsets", [], Parameter.Type.DOUBLE_ARRAY) == ""
    assert reported[0].threshold == 1.0 and node.get_parameter("threshold").value == 1.0


@pytest.mark.parametrize(("name", "value"), [("threshold", 7.0), ("threshold", "x"), ("method", "slow"), ("names", 3)])
def test_a_live_change_is_refused_as_params_refuse_it(made: Made, name: str, value: object) -> None:
    node = made()
    with pytest.raises(ValueError) as expected:
        PotParams().replaced(**{name: value})
    assert set_one(node, name, value) == str(expected.value)
    assert node.settings.of(PotParams) == PotParams()


def test_a_read_only_parameter_stays(made: Made) -> None:
    node = made()
    assert "read-only" in set_one(node, "count", 4)
    assert node.settings.of(PotParams).count == 3
