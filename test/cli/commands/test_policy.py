# SPDX-License-Identifier: Apache-2.0
"""The policies of config/sros2/: who may what, by sros2's own schema and translation where sros2 is installed."""

from __future__ import annotations

import ast
import re
from collections import defaultdict
from fnmatch import fnmatchcase
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from click.testing import CliRunner

from objreg_tools.cli import access
from objreg_tools.cli.access import Access, expanded
from objreg_tools.cli.commands.policy import FILES, PolicyOptions, command, enclaves_of, policy_text, write_files
from objreg_tools.cli.settings import NODES

OURS = {  # by topic the only nodes that may write it
    "objects": {"segmenter"},
    "view": {"segmenter"},
    "keyframes": {"keyframer"},
    "constraints": {"registrar"},
    "loop_closures": {"registrar"},
    "localisation_state": {"registrar"},
    "labels": {"detector", "segmenter"},
    "/fleet/summaries": {"registrar"},
    "/fleet/requests": {"registrar"},
    "/fleet/keyframes": {"registrar"},
}
COMMANDS = ("reset", "save", "enable", "veto", "set_parameters", "set_parameters_atomically", "change_state")
ROBOT = FILES["config/sros2/robot1.policy.xml"]
Rules = dict[tuple[str, str], set[str]]  # by verb and full name the enclaves that may


def rules(text: str) -> Rules:
    """What a policy allows, with all names in full."""
    found: Rules = defaultdict(set)
    for enclave in ElementTree.fromstring(text.encode()).iter("enclave"):
        for profile in enclave.iter("profile"):
            for group in profile:
                ((verb, permission),) = group.attrib.items()
                assert permission == "ALLOW"
                for name in expanded([item.text or "" for item in group], profile.attrib["ns"], profile.attrib["node"]):
                    found[verb, name].add(enclave.attrib["path"].rpartition("/")[2])
    return found


def may(found: Rules, verb: str, name: str) -> set[str]:
    """The enclaves that may do that, composed nodes left out; names are compared as DDS compares them."""
    return {e for (v, rule), who in found.items() if v == verb and fnmatchcase(name, rule) for e in who} - {"graph"}


@pytest.mark.parametrize("name", FILES)
def test_a_policy_is_that_of_the_code(repository: Path, name: str) -> None:
    stale = f"{name} is made from objreg_tools/cli/access.py and stale; `objreg policy --write` makes it again"
    assert (repository / name).read_text() == policy_text(FILES[name]), stale


def test_every_policy_that_is_there_is_made(repository: Path) -> None:
    there = {str(path.relative_to(repository)) for path in (repository / "config/sros2").iterdir()}
    assert there == set(FILES)


def test_every_node_that_has_parameters_has_an_access() -> None:
    assert set(access.NODES) == set(NODES)


@pytest.mark.parametrize("asked", FILES.values(), ids=FILES)
def test_only_our_nodes_write_what_is_ours(asked: PolicyOptions) -> None:
    found = rules(policy_text(asked))
    for topic, writers in OURS.items():
        (full,) = expanded([topic], asked.namespace, "")
        assert may(found, "publish", full) == (set() if "/fleet" in full and not asked.exchange else writers), full


@pytest.mark.parametrize("asked", FILES.values(), ids=FILES)
def test_only_the_operator_calls_what_changes_a_node(asked: PolicyOptions) -> None:
    found = rules(policy_text(asked))
    served = {name for verb, name in found if verb == "reply" and name.rpartition("/")[2] in COMMANDS}
    called = {name for name in served if may(found, "request", name)}
    assert all(may(found, "request", name) <= {"operator"} for name in served)
    assert {name for name in served if "/camera/" not in name and "/operator/" not in name} == called


@pytest.mark.parametrize("asked", FILES.values(), ids=FILES)
def test_no_node_answers_for_another(asked: PolicyOptions) -> None:
    found = rules(policy_text(asked))
    for verb, name in found:
        if verb == "reply" and "*" not in name:
            assert may(found, verb, name) == {"sources" if "/camera/" in name else name.split("/")[-2]}


def test_sources_write_what_a_camera_does_and_nothing_of_ours() -> None:
    written = set(enclaves_of(PolicyOptions())["sources"]["camera"].writes)
    assert {"image", "depth/image", "points", "camera_info", "odom", "imu", "tf", "tf_static", "masks"} <= written
    assert not written & access.OWN


def test_a_remapped_topic_is_allowed_where_it_is_and_no_longer_where_it_was() -> None:
    found = rules(policy_text(PolicyOptions("/robot1", {"image": "/kinect/rgb"})))
    assert may(found, "subscribe", "/kinect/rgb") == {"detector", "segmenter", "blackbox"}
    assert may(found, "publish", "/kinect/rgb") == {"sources"}
    assert not may(found, "subscribe", "/robot1/image")


def test_robots_of_one_registrar_are_read_and_their_paths_written() -> None:
    found = rules(policy_text(PolicyOptions(robots={"r1": ("front", "rear"), "r2": ()})))
    for topic in ("/r1/front/keyframes", "/r1/rear/labels", "/r2/keyframes"):
        assert may(found, "subscribe", topic) == {"registrar"}
        assert not may(found, "publish", topic)
    assert may(found, "publish", "/r2/correction") == {"mapper"} and may(found, "subscribe", "/r1/odom") == {"mapper"}


def test_accesses_add_up_without_doubles() -> None:
    assert Access(("a",)) + Access(("b", "a"), ("c",)) == Access(("a", "b"), ("c",))


def test_the_command_takes_names_as_the_nodes_do() -> None:
    words = ["--namespace", "robot1", "--remap", "image:=/rgb", "--robot", "r1 front", "--exchange", "/fleet"]
    shown = CliRunner().invoke(command, [*words, "--source", "kinect", "--enclaves", "/lab"])
    asked = PolicyOptions("/robot1", {"image": "/rgb"}, {"r1": ("front",)}, "/fleet", ("kinect",), "/lab")
    assert shown.output == policy_text(asked)


def test_what_is_no_remap_is_refused_by_name() -> None:
    refused = CliRunner().invoke(command, ["--remap", "image=/rgb"])
    assert isinstance(refused.exception, ValueError)
    assert str(refused.exception) == "--remap: expected FROM:=TO, got 'image=/rgb'"


def test_writing_needs_a_checkout(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="expected a checkout"):
        write_files(tmp_path)
    (tmp_path / "config").mkdir()
    (tmp_path / "package.xml").touch()
    assert [file.read_text() for file in write_files(tmp_path)] == [policy_text(asked) for asked in FILES.values()]


@pytest.mark.parametrize(("written", "name"), [("docs/security.md", "security"), ("docs/robots.md", "robots")])
def test_the_pages_name_policies_that_are_there(repository: Path, written: str, name: str) -> None:
    named = re.findall(r"config/sros2/[\w.]+", (repository / written).read_text())
    assert named and all((repository / path).exists() for path in named), name


def test_the_page_remaps_for_a_policy_all_that_its_launch_line_remaps(repository: Path) -> None:
    page = (repository / "docs/security.md").read_text()
    launch = ast.parse((repository / "launch/objreg.launch.py").read_text())
    (remapped,) = (
        ast.literal_eval(node.value)
        for node in launch.body
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "REMAPPED"
    )
    given = dict(re.findall(r" (\w+):=(/kinect\S*)", page.split("ros2 launch", 1)[1].split("\n", 1)[0]))
    opened = {topic: given[name] + added for topic, (name, added) in remapped.items() if name in given}
    assert len(given) == 2 and dict(re.findall(r"--remap (\S+):=(\S+)", page)) == opened


@pytest.fixture
def sros2() -> Any:
    """The policy module of sros2."""
    if find_spec("sros2") is None:
        pytest.skip("sros2 is not installed: no policy is checked by its schema")
    return import_module("sros2.policy")


@pytest.mark.parametrize("name", FILES)
def test_a_policy_fits_the_schema_of_sros2(repository: Path, sros2: Any, name: str) -> None:
    assert sros2.load_policy(repository / name).getroot().tag == "policy"


def test_what_does_not_fit_the_schema_is_refused(tmp_path: Path, sros2: Any) -> None:
    (tmp_path / "p.xml").write_text(policy_text(PolicyOptions()).replace('publish="ALLOW"', 'publish="PERHAPS"'))
    with pytest.raises(RuntimeError, match="PERHAPS"):
        sros2.load_policy(tmp_path / "p.xml")


def test_the_permissions_that_sros2_makes_let_the_segmenter_alone_write_objects(repository: Path, sros2: Any) -> None:
    from lxml import etree

    translate = etree.XSLT(etree.parse(str(sros2.get_transport_template("dds", "permissions.xsl"))))
    made = translate(sros2.load_policy(repository / "config/sros2/robot1.policy.xml"))
    etree.XMLSchema(etree.parse(str(sros2.get_transport_schema("dds", "permissions.xsd")))).assertValid(made)
    writers = {
        grant.get("name")
        for grant in made.iter("grant")
        for topic in grant.iterfind("allow_rule/publish/topics/topic")
        if fnmatchcase("rt/robot1/objects", topic.text)
    }
    assert writers == {"/robot1/segmenter", "/robot1/graph"}
    assert {grant.findtext("default") for grant in made.iter("grant")} == {"DENY"}
