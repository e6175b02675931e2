# SPDX-License-Identifier: Apache-2.0
"""The nodes and their parameters: which classes each has, and their values from a ROS 2 parameter file and `--set`."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

import click
import yaml

from objreg_mapper.adapters.params import (
    AdapterParams,
    BodyParams,
    ToG2oParams,
    ToHydraParams,
    ToLioSamParams,
    ToRtabmapParams,
)
from objreg_mapper.params import MapperNodeParams, MapperParams
from objreg_ros.blackbox.params import BlackboxParams
from objreg_ros.bridge.node.params import ManagedParams, NodeBaseParams
from objreg_ros.bridge.streams.params import ExchangeParams, KeyParams, PeerParams, RelocalisedParams
from objreg_ros.detector.params import DetectorParams
from objreg_ros.keyframes.params import KeyframeParams, KeyframerNodeParams
from objreg_ros.params import Declaration, Params
from objreg_ros.registrar.params import RegistrarNodeParams, RegistrarParams
from objreg_ros.segmenter.params import SegmenterNodeParams, SegmenterParams
from objreg_tools.recording.folders.text import SETTINGS_BYTES, read_text

Kind = TypeVar("Kind", bound=Params)

NODES: dict[str, tuple[type[Params], ...]] = {
    "detector": (DetectorParams, ManagedParams, NodeBaseParams),
    "segmenter": (SegmenterParams, SegmenterNodeParams, ManagedParams, NodeBaseParams),
    "registrar": (
        RegistrarParams,
        RegistrarNodeParams,
        ExchangeParams,
        KeyParams,
        PeerParams,
        RelocalisedParams,
        ManagedParams,
        NodeBaseParams,
    ),
    "keyframer": (KeyframeParams, KeyframerNodeParams, KeyParams, ManagedParams, NodeBaseParams),
    "blackbox": (BlackboxParams, ManagedParams, NodeBaseParams),
    "mapper": (MapperParams, MapperNodeParams, ManagedParams, NodeBaseParams),
    "objreg_to_rtabmap": (ToRtabmapParams, BodyParams, AdapterParams, NodeBaseParams),
    "objreg_to_lio_sam": (ToLioSamParams, AdapterParams, NodeBaseParams),
    "objreg_to_hydra": (ToHydraParams, BodyParams, AdapterParams, NodeBaseParams),
    "objreg_to_g2o": (ToG2oParams, BodyParams, AdapterParams, NodeBaseParams),
}
KEY, ALL = "ros__parameters", "/**"
EVERYWHERE = ("use_sim_time",)  # what rclpy itself declares


class Settings:
    """The parameters of every node, checked; ``ignored`` are the sections of their file that are for other nodes."""

    def __init__(self, values: Mapping[str, Mapping[str, Any]], ignored: Sequence[str] = ()) -> None:
        self._values = {node: dict(values.get(node, {})) for node in NODES}
        self.ignored = tuple(ignored)
        for node, kinds in NODES.items():
            _refuse_dropped(node, kinds, self._values[node])
            known = _known(node)
            unknown = sorted(set(self._values[node]) - known)
            if unknown:
                raise ValueError(f"{node}: no parameter {', '.join(unknown)}; there are {', '.join(sorted(known))}")
            for kind in kinds:
                try:
                    self.of(node, kind)
                except ValueError as error:
                    raise ValueError(f"{node}: {error}") from error

    def of(self, node: str, kind: type[Kind]) -> Kind:
        """The values of one class of a node."""
        names = names_of(kind)
        return kind.from_mapping({name: value for name, value in self._values[node].items() if name in names})

    def changed(self) -> dict[str, Any]:
        """The values that are not the defaults, by ``node.parameter``."""
        sections = {(node, kind): self.of(node, kind) for node, kinds in NODES.items() for kind in kinds}
        return {
            f"{node}.{declaration.name}": value
            for (node, kind), params in sections.items()
            for declaration in kind.declarations()
            if (value := getattr(params, declaration.name)) != declaration.default
        }


def _refuse_dropped(node: str, kinds: Iterable[type[Params]], values: Mapping[str, Any]) -> None:
    for kind in kinds:
        try:
            kind.refuse_dropped(values)
        except ValueError as error:
            raise ValueError(f"{node}: {error}") from error


def names_of(kind: type[Params]) -> list[str]:
    """The names of the parameters of a class."""
    return [declaration.name for declaration in kind.declarations()]


def read_settings(file: Path | None, changes: Iterable[str]) -> Settings:
    """Defaults, then a ROS 2 parameter file, then changes like ``registrar.method=paper``; ValueError if refused.

    Parameters of the file under ``/**`` go to the nodes that have them.
    """
    sections = {} if file is None else _sections(file)
    values = {node: _values_of(sections, node) for node in NODES}
    of_file = {node: dict(given) for node, given in values.items()}
    for change in changes:
        node, name, value = parse_change(change)
        values[node][name] = value
    try:
        return Settings(values, [title for title in sections if _node_of(title) not in (ALL, *NODES)])
    except ValueError:
        _require_good(file, of_file)
        raise


def _require_good(file: Path | None, values: Mapping[str, Mapping[str, Any]]) -> None:
    """ValueError with the name of the file where its values are refused even by themselves."""
    try:
        Settings(values)
    except ValueError as error:
        raise ValueError(f"{file}: {error}") from error


def print_ignored(settings: Settings) -> None:
    """Report on stderr which sections of a parameter file are for none of our nodes: one may be misspelt."""
    if settings.ignored:
        names = ", ".join(settings.ignored)
        click.echo(f"! ignored of the parameter file: {names}; the nodes are {', '.join(NODES)}", err=True)


def ros_argument(name: str, value: Any) -> str:
    """``name:=value`` as ROS 2 reads it behind ``-p``, in the type of the value that `parse_change` gave.

    In ROS a list has one type, and text that looks like a number is a number unless it is in quotes. JSON has these
    quotes, and is YAML too.
    """
    return f"{name}:={json.dumps(value, ensure_ascii=False)}"


def _sections(file: Path) -> dict[str, dict[str, Any]]:
    """The parameters under each name of a node, in the order of the file: the last value holds, as in ROS."""
    try:
        sections = dict(_titled(dict(yaml.safe_load(read_text(file, SETTINGS_BYTES)) or {}), ""))
    except (yaml.YAMLError, KeyError, TypeError, ValueError, AttributeError, RecursionError) as error:
        raise ValueError(f"{file}: expected a ROS 2 parameter file (node: {KEY}: name: value), got: {error}") from error
    for_all = {name for title, section in sections.items() if _node_of(title) == ALL for name in section}
    unknown = sorted(for_all - set(EVERYWHERE).union(*map(_known, NODES)))
    if unknown:
        raise ValueError(f"{file}: no node has a parameter {', '.join(unknown)}")
    return sections


def _values_of(sections: Mapping[str, Mapping[str, Any]], node: str) -> dict[str, Any]:
    values: dict[str, Any] = {}
    for title, section in sections.items():
        if _node_of(title) == ALL:
            values |= {name: value for name, value in section.items() if name in _known(node)}
        elif _node_of(title) == node:
            values |= {name: value for name, value in section.items() if name not in EVERYWHERE}
    return values


def _titled(content: Mapping[str, Any], outer: str) -> Iterator[tuple[str, dict[str, Any]]]:
    """Title and parameters of every section, also of those in the section of their namespace."""
    for name, section in content.items():
        title = f"{outer}/{str(name).strip('/')}" if outer else str(name)
        if KEY not in section and section and all(isinstance(inner, Mapping) for inner in section.values()):
            yield from _titled(section, title)
        else:
            yield title, dict(section[KEY])


def _node_of(title: str) -> str:
    """The node that a section is for, in whatever namespace; `ALL` where it is for every one."""
    name = title.rpartition("/")[2]
    return ALL if name in ("*", "**") else name


def _known(node: str) -> set[str]:
    return {name for kind in NODES[node] for name in names_of(kind)}


def parse_change(change: str) -> tuple[str, str, Any]:
    """Node, name and value of a change like ``registrar.seed=7``, the value in its declared type.

    ValueError for another form and for a value that is refused; a name that no node has keeps its text.
    """
    path, sign, text = change.partition("=")
    node, dot, name = path.partition(".")
    if not sign or not dot or node not in NODES:
        raise ValueError(f"--set: expected node.parameter=value with a node of {', '.join(NODES)}, got {change!r}")
    declaration = next((d for kind in NODES[node] for d in kind.declarations() if d.name == name), None)
    try:
        return node, name, text if declaration is None else declaration.check(_value(declaration, text))
    except ValueError as error:
        raise ValueError(f"--set {node}.{error}") from error


def _value(declaration: Declaration, text: str) -> Any:
    """The text as YAML, but a text parameter takes it as it stands, and a list may do without brackets and quotes."""
    if not declaration.many:
        return _value_one(declaration, text)
    try:
        items = yaml.load(text if text.strip().startswith("[") else f"[{text}]", Loader=yaml.BaseLoader)
    except (yaml.YAMLError, RecursionError):
        return text
    return [_value_one(declaration, item) for item in items]


def _value_one(declaration: Declaration, text: Any) -> Any:
    """A value that cannot be read as the declared type stays as it is, and is refused as that."""
    if declaration.kind is str or not isinstance(text, str):
        return text
    try:
        return float(text) if declaration.kind is float else yaml.safe_load(text)
    except (yaml.YAMLError, ValueError, RecursionError):
        return text
