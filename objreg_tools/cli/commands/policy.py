# SPDX-License-Identifier: Apache-2.0
"""`objreg policy`: which node may write, read and call what, as a policy of SROS 2."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import click

from objreg_ros.registrar.params import RegistrarNodeParams
from objreg_ros.whole_file import write_whole
from objreg_tools.cli import access
from objreg_tools.cli.access import Access, expanded

VERSION = "0.2.0"  # of sros2's schema
ENCLAVES = "/objreg"
GRAPH, SOURCES, OPERATOR = "graph", "sources", "operator"
RULES = {"writes": ("topic", "publish"), "reads": ("topic", "subscribe"),
         "serves": ("service", "reply"), "calls": ("service", "request")}  # fmt: skip
REMARK = " Made by `objreg policy`: who may write, read, serve and call what. All else is denied. "


@dataclass(frozen=True)
class PolicyOptions:
    """The graph that a policy is for; ``namespace`` begins with a slash."""

    namespace: str = "/"
    remaps: Mapping[str, str] = field(default_factory=dict)
    robots: Mapping[str, Iterable[str]] = field(default_factory=dict)
    exchange: str = ""
    sources: tuple[str, ...] = ("camera",)
    enclaves: str = ENCLAVES

    def nodes(self) -> dict[str, Access]:
        """Our nodes, as their parameters and remaps make them."""
        more = access.of_robots(self.robots)
        more["registrar"] += access.of_exchange(self.exchange)
        return {name: (own + more.get(name, Access())).renamed(self.remaps) for name, own in access.NODES.items()}


FILES = {
    "config/sros2/objreg.policy.xml": PolicyOptions(),
    "config/sros2/robot1.policy.xml": PolicyOptions("/robot1", exchange="/fleet", enclaves="/robot1"),
    "config/sros2/fleet.policy.xml": PolicyOptions(robots={"robot1": (), "robot2": ()}),
}


@click.command()
@click.option("--namespace", default="/", help="Namespace of the nodes, as /robot1.")
@click.option("--remap", multiple=True, metavar="FROM:=TO", help="A topic of another name, as image:=/kinect/rgb.")
@click.option("--robot", multiple=True, help="As one of the parameter robots: 'robot1', 'robot1 front rear'.")
@click.option("--exchange", default="", help="As the registrar's parameter exchange: /fleet.")
@click.option("--source", multiple=True, default=("camera",), help="Name of a node that writes what ours read.")
@click.option("--enclaves", default=ENCLAVES, show_default=True, help="The path of the enclaves.")
@click.option("--write", is_flag=True, help="Write config/sros2/ of this checkout again.")
def command(
    namespace: str,
    remap: tuple[str, ...],
    robot: tuple[str, ...],
    exchange: str,
    source: tuple[str, ...],
    enclaves: str,
    write: bool,
) -> None:
    """Show a policy of SROS 2 for the nodes: what each may write, read, serve and call.

    Only our nodes write our topics, only the operator calls services: docs/security.md describes its use.
    """
    if write:
        for file in write_files(Path(__file__).resolve().parents[3]):
            click.echo(f"wrote {file}")
        return
    robots = RegistrarNodeParams(robots=robot).cameras
    at = f"/{namespace.strip('/')}"
    click.echo(policy_text(PolicyOptions(at, _rules(remap), robots, exchange, source, enclaves)), nl=False)


def _rules(remap: Iterable[str]) -> dict[str, str]:
    """ValueError for what is no remap."""
    rules = [rule.partition(":=") for rule in remap]
    for name, between, to in rules:
        if not (name and between and to):
            raise ValueError(f"--remap: expected FROM:=TO, got {name + between + to!r}")
    return {name: to for name, _, to in rules}


def write_files(repository: Path) -> list[Path]:
    """Write the policies of config/sros2/; FileNotFoundError outside of a checkout."""
    if not (repository / "package.xml").is_file():
        raise FileNotFoundError(f"{repository}: expected a checkout of the repository; without --write it only prints")
    files = {repository / name: policy_text(asked) for name, asked in FILES.items()}
    for file, text in files.items():
        file.parent.mkdir(exist_ok=True)
        write_whole(file, text)
    return list(files)


def policy_text(asked: PolicyOptions) -> str:
    """The policy as XML: an enclave for each node, for all in one process, for the sources and the operator."""
    policy = Element("policy", version=VERSION)
    enclaves = SubElement(policy, "enclaves")
    for name, profiles in enclaves_of(asked).items():
        enclave = SubElement(enclaves, "enclave", path=f"{asked.enclaves.rstrip('/')}/{name}")
        inside = SubElement(enclave, "profiles")
        for node, allowed in profiles.items():
            _add_profile(inside, asked.namespace, node, allowed)
    ElementTree.indent(policy)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n<!--{REMARK}-->\n{ElementTree.tostring(policy, "unicode")}\n'


def enclaves_of(asked: PolicyOptions) -> dict[str, dict[str, Access]]:
    """What each node of each enclave may do. Names are those that the nodes give, behind remaps."""
    nodes = asked.nodes()
    sources = access.of_sources(access.NODES[name] for name in access.STAGES).renamed(asked.remaps)
    return {
        **{name: {name: allowed} for name, allowed in nodes.items()},
        GRAPH: {name: nodes[name] for name in access.STAGES},
        SOURCES: dict.fromkeys(asked.sources, sources),
        OPERATOR: {OPERATOR: _operator(asked, nodes)},
    }


def _operator(asked: PolicyOptions, nodes: Mapping[str, Access]) -> Access:
    """Reads all that ours write, calls all that they serve. `ros2` makes nodes with names of its own."""
    read, called = (
        tuple(name for node, a in nodes.items() for name in expanded(getattr(a, kind), asked.namespace, node))
        for kind in ("writes", "serves")
    )
    shown = tuple(expanded(access.TF, asked.namespace, OPERATOR))
    own = access.PROCESS + Access(reads=access.LOG, serves=("/_ros2cli_*/get_type_description",))
    return own + Access(reads=read + shown, calls=called)


def _add_profile(inside: Element, namespace: str, node: str, allowed: Access) -> None:
    profile = SubElement(inside, "profile", ns=namespace, node=node)
    for kind, (kind_of_name, verb) in RULES.items():
        names = sorted(getattr(allowed, kind))
        if names:
            rules = SubElement(profile, f"{kind_of_name}s", {verb: "ALLOW"})
            for name in names:
                SubElement(rules, kind_of_name).text = name
