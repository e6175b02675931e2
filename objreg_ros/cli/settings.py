# SPDX-License-Identifier: Apache-2.0
"""The nodes and their parameters: which classes each has, and their values from a ROS 2 parameter file and `--set`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, TypeVar

import yaml

from objreg_ros.bridge.params import DoorParams
from objreg_ros.detector.params import DetectorParams
from objreg_ros.mapper.params import MapperNodeParams, MapperParams
from objreg_ros.params import Declaration, Params
from objreg_ros.registrar.params import RegistrarNodeParams, RegistrarParams
from objreg_ros.segmenter.params import SegmenterNodeParams, SegmenterParams

Kind = TypeVar("Kind", bound=Params)

NODES: dict[str, tuple[type[Params], ...]] = {
    "detector": (DetectorParams, DoorParams),
    "segmenter": (SegmenterParams, SegmenterNodeParams, DoorParams),
    "registrar": (RegistrarParams, RegistrarNodeParams, DoorParams),
    "mapper": (MapperParams, MapperNodeParams, DoorParams),
}
KEY = "ros__parameters"
EVERYWHERE = ("use_sim_time",)  # what rclpy itself declares


class Settings:
    """The parameters of every node, checked."""

    def __init__(self, values: Mapping[str, Mapping[str, Any]]) -> None:
        self._values = {node: dict(values.get(node, {})) for node in NODES}
        for node, kinds in NODES.items():
            known = {name for kind in kinds for name in names_of(kind)}
            unknown = sorted(set(self._values[node]) - known)
            if unknown:
                raise ValueError(f"{node}: no parameter {', '.join(unknown)}; there are {', '.join(sorted(known))}")
            for kind in kinds:
                self.of(node, kind)

    def of(self, node: str, kind: type[Kind]) -> Kind:
        """The values of one class of a node."""
        names = names_of(kind)
        return kind.from_mapping({name: value for name, value in self._values[node].items() if name in names})


def names_of(kind: type[Params]) -> list[str]:
    """The names of the parameters of a class."""
    return [declaration.name for declaration in kind.declarations()]


def read_settings(file: Path | None, changes: Iterable[str]) -> Settings:
    """Defaults, then a ROS 2 parameter file, then changes like ``registrar.method=paper``; ValueError if refused."""
    values = {node: {} if file is None else _values_of(file, node) for node in NODES}
    for change in changes:
        node, name, value = _parse(change)
        values[node][name] = value
    return Settings(values)


def _values_of(file: Path, node: str) -> dict[str, Any]:
    try:
        content = dict(yaml.safe_load(file.read_text()) or {})
        sections = [content[name] for name in ("/**", f"/**/{node}", node, f"/{node}") if name in content]
        return {name: value for section in sections for name, value in section[KEY].items() if name not in EVERYWHERE}
    except (yaml.YAMLError, KeyError, TypeError, ValueError, AttributeError) as error:
        raise ValueError(f"{file}: expected a ROS 2 parameter file (node: {KEY}: name: value), got: {error}") from error


def _parse(change: str) -> tuple[str, str, Any]:
    path, sign, text = change.partition("=")
    node, dot, name = path.partition(".")
    if not sign or not dot or node not in NODES:
        raise ValueError(f"--set: expected node.parameter=value with a node of {', '.join(NODES)}, got {change!r}")
    declaration = next((d for kind in NODES[node] for d in kind.declarations() if d.name == name), None)
    return node, name, text if declaration is None else _value(declaration, text)


def _value(declaration: Declaration, text: str) -> Any:
    """The text as YAML, but a text parameter takes it as it stands, and a list may do without brackets."""
    if declaration.many:
        inner = text.strip().removeprefix("[").removesuffix("]")
        return [_value_one(declaration, part.strip()) for part in inner.split(",") if part.strip()]
    return _value_one(declaration, text)


def _value_one(declaration: Declaration, text: str) -> Any:
    return text if declaration.kind is str else yaml.safe_load(text)
