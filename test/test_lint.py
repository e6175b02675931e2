# SPDX-License-Identifier: Apache-2.0
"""The linters of ament, where they are installed, with the rules that are kept here.

ruff and mypy are run by `scripts/test`, with the style of this package: lines of 120, and docstrings whose first
sentence may take two lines. What contradicts that is left out below, rule by rule.
"""

from __future__ import annotations

import importlib
import shutil
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

import pytest

PACKAGES = ("objreg_ros", "objreg_mapper", "objreg_tools")
CHECKED = (*PACKAGES, "launch", "setup.py")
SPDX = "# SPDX-License-Identifier: Apache-2.0"
FLAKE8 = """[flake8]
max-line-length = 120
select = E,F,W
ignore =
    # where ruff's formatter puts spaces, blank lines and operators
    E203,E301,E704,W503,
    # a comment for a tool at the end of a line; ruff counts the others
    E501
"""
PEP257 = (
    "D205", "D209", "D400", "D415",  # the first sentence may take two lines
    "D213",  # it begins beside the quotes, so not below them
    "D401",  # it says what comes back: "The boxes", not "Return the boxes"
    "D402", "D403",  # it may begin with the name of a thing, as that is written
)  # fmt: skip


@pytest.fixture
def main(monkeypatch: pytest.MonkeyPatch, repository: Path) -> Callable[..., Callable[..., int]]:
    """What a linter's command runs, in the root of the checkout; the test skips where it is not installed."""
    monkeypatch.chdir(repository)

    def found(linter: str, command: str = "main") -> Callable[..., int]:
        try:
            return getattr(importlib.import_module(f"{linter}.main"), command)
        except ImportError:
            pytest.skip(f"{linter} is not installed")

    return found


def test_flake8_finds_no_fault(main: Callable[..., Callable[..., int]], tmp_path: Path) -> None:
    (tmp_path / "flake8.ini").write_text(FLAKE8)
    status, faults = main("ament_flake8", "main_with_errors")(["--config", str(tmp_path / "flake8.ini"), *CHECKED])
    assert status == 0, "\n".join(faults)


def test_pep257_finds_no_fault(main: Callable[..., Callable[..., int]], capsys: pytest.CaptureFixture[str]) -> None:
    status = main("ament_pep257")(["--add-ignore", *PEP257, "--", *CHECKED])
    output = capsys.readouterr()
    assert status == 0, output.out + output.err


def test_the_manifests_are_valid(main: Callable[..., Callable[..., int]], capsys: pytest.CaptureFixture[str]) -> None:
    command = main("ament_xmllint")
    if shutil.which("xmllint") is None:
        pytest.skip("xmllint is not installed")
    status = command(["package.xml", "objreg_msgs/package.xml"])
    output = capsys.readouterr()
    if "download.ros.org" in output.err and "failed to load" in output.err:
        pytest.skip("the schema of manifests cannot be loaded: no network")
    assert status == 0, output.out + output.err


def test_the_licences_are_known_to_ament(main: Callable[..., Callable[..., int]]) -> None:
    main("ament_copyright")
    parse = importlib.import_module("ament_copyright.parser").parse_file
    assert {parse(path).license_identifier for path in ("LICENSE", "objreg_msgs/LICENSE")} == {"apache2"}


def test_ament_misses_a_copyright_notice_and_nothing_else(
    main: Callable[..., Callable[..., int]], capsys: pytest.CaptureFixture[str]
) -> None:
    """It asks each file for a year and a holder; here a file names its licence by SPDX, and LICENSE has the text."""
    main("ament_copyright")(list(CHECKED))
    faults = [line for line in capsys.readouterr().err.splitlines() if ": " in line]
    assert {fault.rpartition(": ")[2] for fault in faults} <= {"could not find copyright notice"}


def test_every_source_names_its_licence_by_spdx(repository: Path) -> None:
    paths = [path for folder in (*PACKAGES, "launch", "examples") for path in (repository / folder).rglob("*.py")]
    without = [path.name for path in paths if SPDX not in path.read_text(encoding="utf-8").splitlines()[:2]]
    assert len(paths) > 100 and without == []


def test_both_packages_carry_the_licence_that_their_manifests_name(repository: Path) -> None:
    for folder in (repository, repository / "objreg_msgs"):
        licence = ElementTree.parse(folder / "package.xml").getroot().find("license")
        assert licence is not None and licence.text == "Apache-2.0"
        assert (folder / licence.attrib["file"]).read_bytes() == (repository / "LICENSE").read_bytes()
