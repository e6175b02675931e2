# SPDX-License-Identifier: Apache-2.0
"""The definition of a message type as text (.msg), made of what its Python class says of its fields.

A file then needs no package of ROS to be read, whatever is installed where it was written.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

PRIMITIVE = {"boolean": "bool", "octet": "byte", "float": "float32", "double": "float64"}
ARRAY = re.compile(r"(?P<kind>.+)\[(?P<count>\d+)\]")
SEQUENCE = re.compile(r"sequence<(?P<kind>.+?)(, *(?P<most>\d+))?>")
BOUNDED = re.compile(r"(?P<kind>w?string)<(?P<most>\d+)>")
BETWEEN = "=" * 80


def definition(msgtype: str, class_of: Callable[[str], Any]) -> str:
    """The text of a type, as `sensor_msgs/msg/Image`, and behind it those of all types that it has.

    ``class_of`` gives the class of such a name; what it raises for one that is not installed goes on.
    """
    parts, wanted, seen = list[str](), [_short(msgtype)], set[str]()
    while wanted:
        name = wanted.pop(0)
        if name in seen:
            continue
        lines = [(_field(text), field) for field, text in class_of(_long(name)).get_fields_and_field_types().items()]
        parts.append((f"MSG: {name}\n" if seen else "") + "".join(f"{kind} {field}\n" for kind, field in lines))
        seen.add(name)
        wanted += [base for kind, _ in lines if "/" in (base := kind.split("[")[0])]
    return f"{BETWEEN}\n".join(parts)


def _field(text: str) -> str:
    """The type of a field as .msg has it, of what rosidl says."""
    if match := ARRAY.fullmatch(text):
        return f"{_field(match['kind'])}[{match['count']}]"
    if match := SEQUENCE.fullmatch(text):
        return f"{_field(match['kind'])}[{'<=' + match['most'] if match['most'] else ''}]"
    if match := BOUNDED.fullmatch(text):
        return f"{match['kind']}<={match['most']}"
    return PRIMITIVE.get(text, text)


def _short(name: str) -> str:
    return name.replace("/msg/", "/")


def _long(name: str) -> str:
    package, _, kind = _short(name).partition("/")
    return f"{package}/msg/{kind}"
