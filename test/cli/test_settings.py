# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from pathlib import Path

import pytest

from objreg_ros.detector.params import DetectorParams
from objreg_ros.registrar.params import RegistrarNodeParams, RegistrarParams
from objreg_ros.segmenter.params import SegmenterNodeParams, SegmenterParams
from objreg_tools.cli.settings import (
    NODES,
    Settings,
    names_of,
    parse_change,
    print_ignored,
    read_settings,
    ros_argument,
)


def test_without_anything_the_defaults_hold() -> None:
    settings = read_settings(None, ())
    assert settings.of("detector", DetectorParams) == DetectorParams()
    assert settings.of("segmenter", SegmenterNodeParams) == SegmenterNodeParams()


def test_a_parameter_file_is_read_as_ros_reads_it(tmp_path: Path) -> None:
    file = tmp_path / "p.yaml"
    file.write_text(
        "/**:\n  ros__parameters: {use_sim_time: true, T_base_camera: [0, 0, 1, 0, 0, 0, 1]}\n"
        "segmenter:\n  ros__parameters: {z_max: 3, slop: 0.5}\n"
        "/detector:\n  ros__parameters: {threshold: 0.25}\n"
    )
    settings = read_settings(file, ())
    assert settings.of("segmenter", SegmenterParams).z_max == 3.0
    assert settings.of("segmenter", SegmenterNodeParams).slop == 0.5
    assert settings.of("detector", DetectorParams).threshold == 0.25
    for node, kind in (("segmenter", SegmenterNodeParams), ("registrar", RegistrarNodeParams)):
        assert settings.of(node, kind).T_base_camera == (0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)


@pytest.mark.parametrize("titles", [("registrar", "/**"), ("/**", "/**/registrar"), ("/registrar", "registrar")])
def test_of_two_sections_the_last_in_the_file_holds_as_in_ros(titles: tuple[str, str], tmp_path: Path) -> None:
    file = tmp_path / "p.yaml"
    for first, last in (titles, titles[::-1]):
        file.write_text(f"{first}:\n  ros__parameters: {{seed: 1}}\n{last}:\n  ros__parameters: {{seed: 2}}\n")
        assert read_settings(file, ()).of("registrar", RegistrarParams).seed == 2


@pytest.mark.parametrize("title", ["/robot/registrar", "robot/registrar", "/*/registrar", "/robot/**", "/*"])
def test_a_section_is_for_a_node_by_the_last_part_of_its_name(title: str, tmp_path: Path) -> None:
    (tmp_path / "p.yaml").write_text(f"{title}:\n  ros__parameters: {{seed: 5}}\n")
    settings = read_settings(tmp_path / "p.yaml", ())
    assert settings.of("registrar", RegistrarParams).seed == 5 and not settings.ignored


def test_a_section_may_lie_in_that_of_its_namespace(tmp_path: Path) -> None:
    (tmp_path / "p.yaml").write_text("robot:\n  registrar:\n    ros__parameters: {seed: 5}\n")
    assert read_settings(tmp_path / "p.yaml", ()).of("registrar", RegistrarParams).seed == 5


def test_a_section_that_is_for_no_node_of_ours_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "p.yaml").write_text("/**/registar:\n  ros__parameters: {seed: 5}\ncamera:\n  ros__parameters: {}\n")
    settings = read_settings(tmp_path / "p.yaml", ())
    assert settings.ignored == ("/**/registar", "camera")
    print_ignored(settings)
    print_ignored(read_settings(None, ()))
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("! ignored of the parameter file: /**/registar, camera; the nodes are detector, segmenter")


def test_a_refused_value_is_reported_with_its_file_and_node_or_with_its_option(tmp_path: Path) -> None:
    file = tmp_path / "p.yaml"
    file.write_text("/**/detector:\n  ros__parameters: {threshold: 2.0}\n")
    with pytest.raises(ValueError, match=r"p\.yaml: detector: threshold: expected 0 … 1, got 2\.0"):
        read_settings(file, ["registrar.seed=1"])
    with pytest.raises(ValueError, match=r"--set detector\.threshold: expected 0 … 1, got 2\.0"):
        read_settings(None, ["detector.threshold=2"])


def test_what_a_file_says_may_be_good_only_with_a_change(tmp_path: Path) -> None:
    (tmp_path / "p.yaml").write_text("segmenter:\n  ros__parameters: {z_min: 5.0}\n")
    assert read_settings(tmp_path / "p.yaml", ["segmenter.z_max=6"]).of("segmenter", SegmenterParams).z_min == 5.0


def test_a_parameter_that_no_node_has_is_refused_even_for_all(tmp_path: Path) -> None:
    file = tmp_path / "p.yaml"
    file.write_text("/**:\n  ros__parameters: {treshold: 0.25}\n")
    with pytest.raises(ValueError, match="no node has a parameter treshold"):
        read_settings(file, ())


def test_a_change_wins_over_the_file(tmp_path: Path) -> None:
    file = tmp_path / "p.yaml"
    file.write_text("registrar:\n  ros__parameters: {method: objreg, seed: 1}\n")
    registrar = read_settings(file, ["registrar.method=paper", "registrar.seed=7"]).of("registrar", RegistrarParams)
    assert (registrar.method, registrar.seed) == ("paper", 7)


def test_text_stays_text_and_lists_are_lists() -> None:
    changes = ["detector.model=1e3", "detector.ignore=dining table, person", "detector.label_offset=1"]
    detector = read_settings(None, changes).of("detector", DetectorParams)
    assert (detector.model, detector.ignore, detector.label_offset) == ("1e3", ("dining table", "person"), "1")
    assert read_settings(None, ["detector.ignore=[]"]).of("detector", DetectorParams).ignore == ()


def test_a_list_may_have_quotes_and_a_number_an_exponent() -> None:
    changes = ['registrar.label_groups=["cup mouse", "tv, big"]', "registrar.T_base_camera=[0, 0, 1e-1, 0, 0, 0, 1]"]
    settings = read_settings(None, changes)
    assert settings.of("registrar", RegistrarParams).label_groups == ("cup mouse", "tv, big")
    assert settings.of("registrar", RegistrarNodeParams).T_base_camera == (0.0, 0.0, 0.1, 0.0, 0.0, 0.0, 1.0)


@pytest.mark.ros
@pytest.mark.parametrize(
    "change",
    [
        "registrar.T_base_camera=0,0,0.1,0,0,0,1",
        "registrar.label_groups=cup mouse,tv laptop",
        "registrar.label_groups=",
        "registrar.store=123",
        "registrar.store=",
        'registrar.store=a "b" /\\ ü: [c]',
        "registrar.min_gap=1",
        "registrar.min_gap=1e-05",
        "registrar.seed=7",
        "segmenter.colour=false",
    ],
)
def test_a_node_takes_a_change_as_an_offline_run_does(change: str) -> None:
    pytest.importorskip("rclpy", reason="ROS 2 is not installed")
    from rclpy.context import Context
    from rclpy.node import Node

    from objreg_ros.bridge.node.parameters import Parameters

    stage, name, value = parse_change(change)
    context = Context()
    context.init(args=["--ros-args", "-p", ros_argument(name, value)])
    node = Node(stage, context=context, start_parameter_services=False)
    parameters, settings = Parameters(node, *NODES[stage]), read_settings(None, [change])
    for kind in NODES[stage]:
        assert parameters.of(kind) == settings.of(stage, kind)
    node.destroy_node()
    context.try_shutdown()


@pytest.mark.parametrize("change", ["method=paper", "registrar.method", "lidar.range=3", "registrar=1"])
def test_a_change_of_another_form_is_refused(change: str) -> None:
    with pytest.raises(ValueError, match=r"--set: expected node\.parameter=value"):
        read_settings(None, [change])


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        ("registrar.metod=paper", "registrar: no parameter metod"),
        ("registrar.method=magic", "expected one of objreg, paper, got 'magic'"),
        ("detector.threshold=2", "expected 0 … 1, got 2.0"),
        ("detector.threads=many", "expected int, got 'many'"),
        ("detector.threshold=[", "expected float, got '\\['"),
        ("registrar.T_base_camera=[0, 1", "expected a list of float, got '\\[0, 1'"),
        ("registrar.T_base_camera=[a: 1]", "expected float, got {'a': '1'}"),
    ],
)
def test_a_value_that_cannot_be_is_refused(change: str, complaint: str) -> None:
    with pytest.raises(ValueError, match=complaint):
        read_settings(None, [change])


@pytest.mark.parametrize("text", ["a: [", "detector: 3", "detector: {threshold: 0.2}", "- 1"])
def test_a_file_of_another_form_is_refused(text: str, tmp_path: Path) -> None:
    (tmp_path / "p.yaml").write_text(text)
    with pytest.raises(ValueError, match="expected a ROS 2 parameter file"):
        read_settings(tmp_path / "p.yaml", ())


@pytest.mark.parametrize("node", NODES)
def test_no_two_classes_of_a_node_share_a_name(node: str) -> None:
    names = [name for kind in NODES[node] for name in names_of(kind)]
    assert len(names) == len(set(names))


def test_settings_of_an_unknown_parameter_are_refused() -> None:
    with pytest.raises(ValueError, match="no parameter speed"):
        Settings({"detector": {"speed": 1}})


def test_what_differs_from_the_defaults_is_listed_and_nothing_else() -> None:
    assert read_settings(None, []).changed() == {}
    changes = ["registrar.seed=7", "detector.threshold=0.4", "segmenter.slop=0.02"]
    assert read_settings(None, changes).changed() == {"detector.threshold": 0.4, "registrar.seed": 7}
