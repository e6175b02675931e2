# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import re
from pathlib import Path

import pytest
import yaml
from click.testing import CliRunner

from objreg_mapper.params import MapperParams
from objreg_tools.cli.commands.params import (
    TABLE_FILE,
    YAML_FILE,
    command,
    page_text,
    table_text,
    write_files,
    yaml_text,
    yaml_value,
)
from objreg_tools.cli.settings import KEY, NODES, read_settings

STALE = "made from the parameters and stale; `objreg params --write` makes it again"


def test_the_parameter_file_is_that_of_the_code(repository: Path) -> None:
    assert (repository / YAML_FILE).read_text() == yaml_text(), f"{YAML_FILE} is {STALE}"


def test_the_page_of_parameters_is_that_of_the_code(repository: Path) -> None:
    assert (repository / TABLE_FILE).read_text() == page_text(), f"{TABLE_FILE} is {STALE}"


@pytest.mark.parametrize("document", ["README.md", "docs/tutorials/tune.md"])
def test_a_document_speaks_of_parameters_that_exist(repository: Path, document: str) -> None:
    rows = (repository / document).read_text().partition("## Parameters")[2].partition("\n## ")[0]
    spoken_of = re.findall(r"^\| `(\w+)\.(\w+)` \| `(.+?)` \|", rows, re.MULTILINE)
    declared = {
        (node, declaration.name): yaml_value(declaration.default)
        for node, kinds in NODES.items()
        for kind in kinds
        for declaration in kind.declarations()
    }
    assert spoken_of and all(declared[node, name] == default for node, name, default in spoken_of)


def test_every_node_has_every_parameter_in_the_file_with_its_default() -> None:
    content = yaml.safe_load(yaml_text())
    for node, kinds in NODES.items():
        for declaration in (d for kind in kinds for d in kind.declarations()):
            if declaration.default == ():
                assert declaration.name not in content[f"/**/{node}"][KEY]
            else:
                assert declaration.check(content[f"/**/{node}"][KEY][declaration.name]) == declaration.default


def test_the_file_says_what_the_defaults_say(tmp_path: Path) -> None:
    (tmp_path / "p.yaml").write_text(yaml_text())
    settings, defaults = read_settings(tmp_path / "p.yaml", ()), read_settings(None, ())
    for node, kinds in NODES.items():
        assert [settings.of(node, kind) for kind in kinds] == [defaults.of(node, kind) for kind in kinds]


def test_what_is_changed_in_a_copy_of_the_file_is_read_by_its_node(tmp_path: Path) -> None:
    (tmp_path / "p.yaml").write_text(yaml_text().replace("keyframe_translation: 0.25", "keyframe_translation: 0.5"))
    assert read_settings(tmp_path / "p.yaml", ()).of("mapper", MapperParams).keyframe_translation == 0.5


@pytest.mark.parametrize("file", [YAML_FILE, "config/covariance.yaml"])
def test_every_section_of_a_file_to_be_passed_to_nodes_holds_in_any_namespace(repository: Path, file: str) -> None:
    sections = list(yaml.safe_load((repository / file).read_text()))
    assert sections and set(sections) <= {f"/**/{node}" for node in NODES}


def test_a_value_is_read_back_in_its_type() -> None:
    for value in [1.0, 1e-7, 1e22, 0.1, -3.0, 5, True, "", "a: #b", "1", ("x y", "z"), (1.0, 2.5)]:
        back = yaml.safe_load(yaml_value(value))
        back = tuple(back) if isinstance(back, list) else back
        assert back == value and type(back) is type(value), value


def test_writing_makes_both_files_again(tmp_path: Path) -> None:
    for place in ("config", "docs"):
        (tmp_path / place).mkdir()
    (tmp_path / "package.xml").touch()
    assert [file.read_text() for file in write_files(tmp_path)] == [yaml_text(), page_text()]


def test_outside_of_a_checkout_nothing_is_written(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="expected a checkout"):
        write_files(tmp_path)


def test_the_command_shows_both_forms() -> None:
    assert CliRunner().invoke(command, ["--yaml"]).output == yaml_text()
    assert CliRunner().invoke(command, []).output == table_text()


DANGLING = re.compile(
    r"(and|or|so|the same|its|such|unless|at which|of that)\b|.*(: there|\bthose|\bthat)$", re.IGNORECASE
)


def test_a_parameter_explains_itself_without_its_neighbours() -> None:
    leaning = [
        f"{node}.{declaration.name}: {declaration.doc}"
        for node, kinds in NODES.items()
        for kind in kinds
        for declaration in kind.declarations()
        if DANGLING.match(declaration.doc)
    ]
    assert not leaning, "`ros2 param describe` shows one at a time"
