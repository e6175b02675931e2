# SPDX-License-Identifier: Apache-2.0
"""A parameter is declared once, as a field of its node's frozen dataclass:

    @dataclass(frozen=True)
    class DetectorParams(Params):
        threshold: float = param(0.5, "least score of a detection", ge=0.0, le=1.0)

From that line come the ROS declaration with description and range, config/objreg.yaml, docs/parameters.md, and the same
refusal in a node, a test and an offline run. This file knows neither ROS nor any node.
"""

from __future__ import annotations

import dataclasses
import math
import re
import types
import typing
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Self

from objreg_ros.geometry import Array, mounting

AUTO = "auto"
NAMESPACE = re.compile("/?[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*")


@dataclasses.dataclass(frozen=True, slots=True)
class Declaration:
    """What is known of one parameter. ``kind`` is bool, int, float or str, or a tuple of one of them when ``many``."""

    name: str
    kind: type[Any]
    many: bool
    default: Any
    doc: str
    unit: str = ""
    ge: float | None = None
    le: float | None = None
    choices: tuple[str, ...] = ()
    live: bool = False
    counts: tuple[int, ...] = ()  # how long a list may be; empty: any length
    or_auto: bool = False  # whether "auto" stands for an empty list
    at_start: bool = False  # whether it is set at the start alone, in a managed node too

    def check(self, value: Any) -> Any:
        """The value in its declared type; ValueError with expected and got if it is not that or out of range."""
        if self.many:
            value = () if self.or_auto and value == AUTO else value
            items = value.tolist() if hasattr(value, "tolist") else value
            if not isinstance(items, list | tuple):
                raise ValueError(f"{self.name}: expected a list of {self.kind.__name__}, got {value!r}")
            if self.counts and len(items) not in self.counts:
                expected = " or ".join(map(str, self.counts))
                raise ValueError(f"{self.name}: expected {expected} values, got {len(items)}: {items!r}")
            return tuple(self._check_one(item) for item in items)
        return self._check_one(value)

    def _check_one(self, value: Any) -> Any:
        if self.kind is float and isinstance(value, int) and not isinstance(value, bool):
            value = float(value)
        if not isinstance(value, self.kind) or (self.kind is int and isinstance(value, bool)):
            raise ValueError(f"{self.name}: expected {self.kind.__name__}, got {value!r}")
        if self.kind is float and not math.isfinite(value):
            raise ValueError(f"{self.name}: expected a finite number, got {value!r}")
        if (self.ge is not None and value < self.ge) or (self.le is not None and value > self.le):
            raise ValueError(f"{self.name}: expected {self.range_text}, got {value!r}")
        if self.choices and value not in self.choices:
            raise ValueError(f"{self.name}: expected one of {', '.join(self.choices)}, got {value!r}")
        return value

    @property
    def range_text(self) -> str:
        """The range or the choices as text; empty if anything goes."""
        if self.choices:
            return " | ".join(self.choices)
        if self.ge is not None and self.le is not None:
            return f"{self.ge:g} … {self.le:g}"
        if self.ge is not None:
            return f"at least {self.ge:g}"
        return f"at most {self.le:g}" if self.le is not None else ""


def param(
    default: Any,
    doc: str,
    unit: str = "",
    ge: float | None = None,
    le: float | None = None,
    choices: tuple[str, ...] = (),
    live: bool = False,
    counts: tuple[int, ...] = (),
    or_auto: bool = False,
    at_start: bool = False,
) -> Any:
    """Declare one parameter. ``live`` ones may be changed while a node runs; the others are read-only there.

    ``at_start`` ones are set at the start only, in a managed node too: what is written, and what peers may ask for.
    """
    metadata = {"doc": doc, "unit": unit, "ge": ge, "le": le, "choices": choices, "live": live, "counts": counts}
    metadata |= {"or_auto": or_auto, "at_start": at_start}
    return dataclasses.field(default=default, metadata=metadata)


@dataclasses.dataclass(frozen=True)
class Params:
    """The base of every node's parameters; checks all values when it is made.

    ``DROPPED`` names those that the last release had, with what took their place.
    """

    DROPPED: typing.ClassVar[Mapping[str, str]] = {}

    def __post_init__(self) -> None:
        for declaration in self.declarations():
            value = declaration.check(getattr(self, declaration.name))
            object.__setattr__(self, declaration.name, value)

    @classmethod
    def declarations(cls) -> tuple[Declaration, ...]:
        """Every parameter of this class, in the order of its fields."""
        hints = typing.get_type_hints(cls)
        return tuple(_declaration(field, hints[field.name]) for field in dataclasses.fields(cls))

    @classmethod
    def refuse_dropped(cls, names: Iterable[str]) -> None:
        """ValueError for the first name that only the last release had."""
        for name in names:
            if name in cls.DROPPED:
                raise ValueError(f"{name}: no parameter any more; {cls.DROPPED[name]}")

    @classmethod
    def from_mapping(cls, values: Mapping[str, Any]) -> Self:
        """Parameters from a mapping; ValueError for a name that is not declared."""
        names = [declaration.name for declaration in cls.declarations()]
        unknown = sorted(set(values) - set(names))
        cls.refuse_dropped(unknown)
        if unknown:
            raise ValueError(f"{cls.__name__}: no parameter {', '.join(unknown)}; there are {', '.join(names)}")
        return cls(**values)

    def replaced(self, **values: Any) -> Self:
        """A copy with some values changed, checked again."""
        return type(self).from_mapping({**dataclasses.asdict(self), **values})


@dataclasses.dataclass(frozen=True)
class MountedParams(Params):
    """Those of a node that reads where the camera is mounted."""

    T_base_camera: tuple[float, ...] = param(
        (),
        "the camera's optical frame on the odometry's body: x y z qx qy qz qw; empty or auto: as /tf_static or /tf "
        "say, else measured from the motion of both",
        or_auto=True,
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        mounting(self.T_base_camera)

    @property
    def mounting(self) -> Array | None:
        """``T_base_camera`` as a (4, 4) pose, None where none is set."""
        return mounting(self.T_base_camera)


@dataclasses.dataclass(frozen=True)
class FramesParams(MountedParams):
    """How frames are brought together with odometry."""

    odom_slop: float = param(
        0.02,
        "largest distance in time between a frame and its odometry, unless two within seven times it enclose the frame",
        "s",
        ge=0.0,
    )


def require_namespaces(name: str, values: Sequence[str]) -> None:
    """ValueError for a parameter ``name`` unless its values are distinct names of ROS namespaces."""
    if len({value.strip("/") for value in values}) < len(values) or not all(map(NAMESPACE.fullmatch, values)):
        raise ValueError(f"{name}: expected distinct names of namespaces, got {list(values)}")


def _declaration(field: dataclasses.Field[Any], hint: Any) -> Declaration:
    many = typing.get_origin(hint) is tuple
    kind = typing.get_args(hint)[0] if many else hint
    if isinstance(kind, types.UnionType) or kind not in (bool, int, float, str):
        raise TypeError(f"{field.name}: a parameter is bool, int, float, str or a tuple of one, got {hint}")
    return Declaration(name=field.name, kind=kind, many=many, default=field.default, **field.metadata)
