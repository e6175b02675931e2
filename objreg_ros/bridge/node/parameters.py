# SPDX-License-Identifier: Apache-2.0
"""The ROS parameters of a node, made from its `Params` classes: description, type, range, read-only or live.

`Params` refuses values, so the messages are those of a test or an offline run. A float accepts 1, and an empty list
keeps the type that was declared.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from difflib import get_close_matches
from typing import Any, TypeVar

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.node import Node
from rclpy.parameter import Parameter

from objreg_ros.bridge.node.params import ManagedParams
from objreg_ros.params import Declaration, Params
from objreg_ros.terminal import with_ros2cli

Kind = TypeVar("Kind", bound=Params)

OF_ROS = ("use_sim_time", "start_type_description_service", "qos_overrides.")  # declared where ROS wants them
FOR_LIFE = tuple(declaration.name for declaration in ManagedParams.declarations())  # never changed
TYPES = {
    (bool, False): Parameter.Type.BOOL,
    (int, False): Parameter.Type.INTEGER,
    (float, False): Parameter.Type.DOUBLE,
    (str, False): Parameter.Type.STRING,
    (bool, True): Parameter.Type.BOOL_ARRAY,
    (int, True): Parameter.Type.INTEGER_ARRAY,
    (float, True): Parameter.Type.DOUBLE_ARRAY,
    (str, True): Parameter.Type.STRING_ARRAY,
}


class Parameters:
    """The declared parameters of ``node`` and their current values, one `Params` a class.

    ValueError at construction for a start value that is refused; a name that nobody declared is warned of.
    ``changed`` is called after a change. Those of a managed node that are not live can be changed too, while
    ``are_open`` is true, unless they are of the start alone.
    """

    def __init__(self, node: Node, *kinds: type[Params]) -> None:
        self.changed: Callable[[], None] = lambda: None
        self.are_open: Callable[[], bool] = lambda: False
        self._declarations = {d.name: d for kind in kinds for d in kind.declarations()}
        try:
            start = {name: _declare(node, declaration) for name, declaration in self._declarations.items()}
            self._current = {kind: kind(**_part(kind, start)) for kind in kinds}
            self._is_managed = ManagedParams in kinds and self.of(ManagedParams).managed
            for declaration in self._declarations.values():
                node.set_descriptor(declaration.name, descriptor(declaration, self._is_fixed(declaration)))
            _refuse_dropped(node, kinds)
        except ValueError as error:
            raise ValueError(f"{node.get_name()}: {error}") from error
        _warn_of_unknown(node, list(self._declarations))
        node.add_post_set_parameters_callback(self._adopt)

    def of(self, kind: type[Kind]) -> Kind:
        """The current values of one class."""
        return self._current[kind]  # type: ignore[return-value]

    def checked(self, changes: Sequence[Parameter]) -> list[Parameter]:
        """The changes in their declared types; ValueError with `Params`' message if any is refused."""
        values = {p.name: p.value for p in changes}
        for kind, current in self._current.items():
            current.replaced(**_part(kind, values))
        if self._is_managed and not self.are_open():
            for name in values:
                if name in self._declarations and not self._declarations[name].live:
                    raise ValueError(f"{name}: expected to be changed while unconfigured; clean the node up first")
        return [self._typed(change) for change in changes]

    def _is_fixed(self, declaration: Declaration) -> bool:
        """Whether ROS itself refuses every change."""
        for_life = declaration.at_start or declaration.name in FOR_LIFE
        return not declaration.live and (not self._is_managed or for_life)

    def _typed(self, change: Parameter) -> Parameter:
        declaration = self._declarations.get(change.name)
        return change if declaration is None else _parameter(declaration, declaration.check(change.value))

    def _adopt(self, changes: Sequence[Parameter]) -> None:
        values = {p.name: p.value for p in changes}
        touched = [kind for kind in self._current if _part(kind, values)]
        for kind in touched:
            self._current[kind] = self._current[kind].replaced(**_part(kind, values))
        if touched:
            self.changed()


def _part(kind: type[Params], values: dict[str, Any]) -> dict[str, Any]:
    return {d.name: values[d.name] for d in kind.declarations() if d.name in values}


def _refuse_dropped(node: Node, kinds: Sequence[type[Params]]) -> None:
    """ValueError for a start value of a parameter that the last release had; it would be ignored in silence."""
    given = getattr(node, "_parameter_overrides", {})  # rclpy exposes them nowhere else
    for kind in kinds:
        kind.refuse_dropped(given)


def _warn_of_unknown(node: Node, known: Sequence[str]) -> None:
    """Say which start values nobody asked for: ROS drops them in silence, and with them a slip of the pen."""
    given = getattr(node, "_parameter_overrides", {})  # rclpy exposes them nowhere else
    for name in given:
        if not node.has_parameter(name) and not name.startswith(OF_ROS):
            near = get_close_matches(name, known, n=1)
            listed = with_ros2cli(f"see `ros2 param list {node.get_fully_qualified_name()}`", "see `objreg params`")
            hint = f"did you mean {near[0]}?" if near else listed
            node.get_logger().warning(f"parameter {name} is ignored: this node has none of that name; {hint}")


def _declare(node: Node, declaration: Declaration) -> Any:
    """Declare without type and range, and let `Params` judge what the user set; the descriptor is fixed afterwards.

    An empty list has no type to ROS, so it arrives as no value at all.
    """
    declared = declaration.check(declaration.default)
    loose = ParameterDescriptor(dynamic_typing=True)
    given = node.declare_parameter(declaration.name, list(declared) if declaration.many else declared, loose).value
    value = declaration.check(given) if given is not None else () if declaration.many else declared
    Node.set_parameters(
        node, [_parameter(declaration, value)]
    )  # rclpy's own: a NodeBase's asks what we are making here
    return value


def _parameter(declaration: Declaration, value: Any) -> Parameter:
    kind = TYPES[declaration.kind, declaration.many]
    return Parameter(declaration.name, kind, list(value) if declaration.many else value)


def descriptor(declaration: Declaration, read_only: bool | None = None) -> ParameterDescriptor:
    """What ``ros2 param describe`` shows of a declaration; read-only if it is not live, where nothing else is said."""
    unit = f" [{declaration.unit}]" if declaration.unit else ""
    made = ParameterDescriptor(
        name=declaration.name,
        type=TYPES[declaration.kind, declaration.many].value,
        description=f"{declaration.doc}{unit}",
        additional_constraints=declaration.range_text,
        read_only=not declaration.live if read_only is None else read_only,
    )
    if declaration.many or (declaration.ge is None and declaration.le is None):
        return made
    if declaration.kind is float:
        made.floating_point_range = [_float_range(declaration)]
    elif declaration.kind is int:
        made.integer_range = [_integer_range(declaration)]
    return made


def _float_range(declaration: Declaration) -> FloatingPointRange:
    low = -sys.float_info.max if declaration.ge is None else float(declaration.ge)
    high = sys.float_info.max if declaration.le is None else float(declaration.le)
    return FloatingPointRange(from_value=low, to_value=high)


def _integer_range(declaration: Declaration) -> IntegerRange:
    low = -(2**63) if declaration.ge is None else int(declaration.ge)
    high = 2**63 - 1 if declaration.le is None else int(declaration.le)
    return IntegerRange(from_value=low, to_value=high, step=0)
