# SPDX-License-Identifier: Apache-2.0
"""What states the release is of one version, and the forms around the project are what a host takes."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import yaml

from objreg_mapper.params import MapperParams
from objreg_ros.data.closures import Reason
from objreg_ros.registrar.params import RegistrarNodeParams
from objreg_ros.registration.gate.kinds import KINDS

FORMS = ("bug", "closure", "idea")
FIELDS = {"checkboxes", "dropdown", "input", "markdown", "textarea"}  # what GitHub knows


def released(repository: Path) -> tuple[str, str]:
    """The newest version of CHANGELOG.md and its date."""
    found = re.search(r"^## \[(\d+\.\d+\.\d+)\] - (\d{4}-\d\d-\d\d)$", (repository / "CHANGELOG.md").read_text(), re.M)
    assert found is not None
    return found[1], found[2]


def loaded(path: Path) -> Any:
    return yaml.safe_load(path.read_text(encoding="utf-8"))


def test_a_file_has_the_version_that_the_changelog_released(repository: Path) -> None:
    for file, line in [
        ("setup.py", 'version="{}",'),
        ("package.xml", "<version>{}</version>"),
        ("objreg_msgs/package.xml", "<version>{}</version>"),
        ("CITATION.cff", "version: {}\n"),
        ("docs/releases/{}.md", "# {}\n"),
    ]:
        version, _ = released(repository)
        assert line.format(version) in (repository / file.format(version)).read_text(), file


def test_the_changelog_has_a_place_for_what_is_not_released(repository: Path) -> None:
    headings = re.findall(r"^## (.+)$", (repository / "CHANGELOG.md").read_text(), re.M)
    assert headings[0] == "[Unreleased]" and headings[1].startswith(f"[{released(repository)[0]}]")


def test_the_citation_has_what_its_format_asks_for_and_the_date_of_the_release(repository: Path) -> None:
    citation = loaded(repository / "CITATION.cff")
    assert {"cff-version", "message", "title", "authors"} <= set(citation)
    assert str(citation["date-released"]) == released(repository)[1] and citation["license"] == "Apache-2.0"


def test_both_packages_have_the_same_licence_file(repository: Path) -> None:
    assert (repository / "LICENSE").read_bytes() == (repository / "objreg_msgs/LICENSE").read_bytes()


def test_a_form_for_issues_asks_what_a_host_can_show(repository: Path) -> None:
    for form in FORMS:
        issue_form = loaded(repository / f".github/ISSUE_TEMPLATE/{form}.yml")
        assert issue_form["name"] and issue_form["description"], form
        asked = [field for field in issue_form["body"] if field["type"] != "markdown"]
        assert {field["type"] for field in issue_form["body"]} <= FIELDS and asked, form
        assert len({field["id"] for field in asked}) == len(asked), form
        assert all(field["attributes"]["label"] for field in asked), form
        assert any(field.get("validations", {}).get("required") for field in asked), form


def test_the_devcontainer_is_a_stage_of_the_image_for_python(repository: Path) -> None:
    settings = json.loads((repository / ".devcontainer/devcontainer.json").read_text())
    dockerfile = (repository / ".devcontainer" / settings["build"]["dockerfile"]).resolve()
    assert f" AS {settings['build']['target']}\n" in dockerfile.read_text()
    assert f"useradd --create-home --uid 1000 {settings['remoteUser']}\n" in dockerfile.read_text()
    assert (repository / settings["postCreateCommand"].split()[0]).is_file()


def test_the_badges_are_files_of_this_repository_and_say_what_the_package_says(repository: Path) -> None:
    readme, setup = (repository / "README.md").read_text(), (repository / "setup.py").read_text()
    shown = re.findall(r"!\[([^]]+)\]\((docs/badges/[a-z]+\.svg)\)", readme)
    texts = {file: (repository / file).read_text() for _, file in shown}
    assert {Path(file).stem for file in texts} == {"licence", "ros", "python"}
    versions = re.findall(r"Python :: (\d\.\d+)", setup)
    assert f">{' | '.join(versions)}<" in texts["docs/badges/python.svg"]
    assert ">Apache-2.0<" in texts["docs/badges/licence.svg"] and 'license="Apache-2.0"' in setup
    assert ">Jazzy<" in texts["docs/badges/ros.svg"] and "ros-jazzy-rclpy" in setup
    assert not any("http" in text.replace("http://www.w3.org/2000/svg", "") for text in texts.values())


def test_the_notes_of_the_release_name_what_the_evidence_and_the_reasons_are_called_now(repository: Path) -> None:
    notes = (repository / f"docs/releases/{released(repository)[0]}.md").read_text()
    renamed = dict(re.findall(r"^\| (?:evidence|reason) \| `(\w+)` \| `(\w+)` \|", notes, re.M))
    known = {*KINDS, *(reason.value for reason in Reason), "surroundings_score"}
    assert set(renamed.values()) <= known and not set(renamed) & known
    dropped = {name for params in (RegistrarNodeParams, MapperParams) for name in params.DROPPED}
    assert all(f"`{name}`" in notes for name in dropped)
