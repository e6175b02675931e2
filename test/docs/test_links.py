# SPDX-License-Identifier: Apache-2.0
"""Links that GitHub follows from a file to another lead to the same place in the site."""

from __future__ import annotations

import pytest

from docs.links import in_repository, in_site, links, target


@pytest.mark.parametrize(
    ("here", "link", "there"),
    [
        ("docs/gate.md", "../ARCHITECTURE.md", "project/ARCHITECTURE.md"),
        ("docs/gate.md", "parameters.md", "parameters.md"),
        ("docs/tutorials/tune.md", "../../config/objreg.yaml", "project/config/objreg.yaml"),
        ("CHANGELOG.md", "docs/own-detector.md", "own-detector.md"),
        ("models/README.md", "../docs/models-contract.md", "models-contract.md"),
        ("docs/wire.md", "../README.md", "index.md"),
        ("QUALITY_DECLARATION.md", ".github/SECURITY.md", "project/SECURITY.md"),
    ],
)
def test_a_link_leads_to_where_the_site_has_its_file(here: str, link: str, there: str) -> None:
    assert in_site(target(here, link)) == there


def test_a_page_of_the_site_knows_its_file_in_the_repository() -> None:
    assert in_repository("project/models/README.md") == "models/README.md"
    assert in_repository("project/SECURITY.md") == ".github/SECURITY.md"
    assert in_repository("tutorials/tune.md") == "docs/tutorials/tune.md"


def test_addresses_anchors_and_code_are_no_files() -> None:
    prose = "[a](https://x.org/y) [b](#here) [c](gate.md#the-odds) ![d](demo.jpg)\n```\n[e](no.md)\n```\n"
    assert links(prose) == ["gate.md", "demo.jpg"]
