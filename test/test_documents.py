# SPDX-License-Identifier: Apache-2.0
"""The documents name what is there: files, headings, and the names that files have."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

from objreg_ros.bridge.streams.sync import Drop
from objreg_ros.data.closures import Reason

REPOSITORY = Path(__file__).resolve().parents[1]
DOCUMENTS = (
    "README.md",
    "ARCHITECTURE.md",
    "CHANGELOG.md",
    "CONTRIBUTING.md",
    ".github/SECURITY.md",
    "QUALITY_DECLARATION.md",
    "models/README.md",
    *sorted(str(path.relative_to(REPOSITORY)) for path in (REPOSITORY / "docs").rglob("*.md")),
)
ROOTS = (
    "",
    "objreg_ros",
    "objreg_mapper",
    "objreg_tools",
    "objreg_ros/registration",
)  # below which a document names files
NAMED_FILE = re.compile(r"`((?:[\w.-]+/)+[\w.-]+\.(?:py|md|yaml|toml|xml|txt|lock|onnx|rviz|json))[^`]*`")
NAMED_FOLDER = re.compile(r"`((?:[a-z_]+/)+)`")
MADE = ("out/", "my_bag/", "OUT/")  # what a command makes or a user has
MOST_LINES = 160


def text(document: str) -> str:
    return (REPOSITORY / document).read_text(encoding="utf-8")


def links(document: str) -> Iterator[str]:
    """The targets of the links of a document that go to files or headings of this repository."""
    prose = re.sub(r"```.*?```", "", text(document), flags=re.DOTALL)
    return (target for target in re.findall(r"\]\(([^)\s]+)\)", prose) if not re.match(r"\w+:", target))


def anchors(document: Path) -> set[str]:
    """The headings of a document as GitHub makes anchors of them."""
    headings = re.findall(r"^#+ (.+)$", document.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def found(name: str) -> Path | None:
    """The file or folder that a document calls by this name; None where there is none."""
    return next((REPOSITORY / root / name for root in ROOTS if (REPOSITORY / root / name).exists()), None)


def names_in_table(heading: str) -> set[str]:
    """The names in the first column of the table below a heading of docs/wire.md."""
    table = text("docs/wire.md").partition(heading)[2].partition("\n## ")[0]
    return set(re.findall(r"^\| `(\w+)` \|", table, re.MULTILINE))


def anchors_of_findings() -> set[str]:
    """The sections that the findings of all sources name outright."""
    found = set()
    for path in REPOSITORY.glob("objreg_*/**/*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and ast.unparse(node.func) == "Finding":
                given = [*node.args[3:4], *(keyword.value for keyword in node.keywords if keyword.arg == "anchor")]
                found |= {str(value.value) for value in given if isinstance(value, ast.Constant)}
    return found


def rows_of_changes() -> list[tuple[str, list[Path], list[str]]]:
    """The rows of ARCHITECTURE.md's last table: what is changed, in which files, by which names."""
    table = text("ARCHITECTURE.md").partition("## 7. Where to change what")[2]
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in table.splitlines() if line[:1] == "|"]
    rows = [
        (what, re.findall(r"`([^`]+)`", files), re.findall(r"`([^`]+)`", names)) for what, files, names in cells[2:]
    ]
    return [(what, [REPOSITORY / "objreg_ros" / file for file in files], names) for what, files, names in rows]


def test_every_link_leads_to_a_file_and_a_heading_that_exist() -> None:
    for document in DOCUMENTS:
        broken = []
        for link in links(document):
            path, _, anchor = link.partition("#")
            target = (REPOSITORY / document).parent / path if path else REPOSITORY / document
            if not target.exists() or (anchor and anchor not in anchors(target)):
                broken.append(link)
        assert not broken, f"{document} has links to {broken}"


def test_every_file_and_folder_that_a_document_names_exists() -> None:
    for document in DOCUMENTS:
        names = NAMED_FILE.findall(text(document)) + NAMED_FOLDER.findall(text(document))
        missing = sorted({name for name in names if not name.startswith(MADE) and found(name) is None})
        assert not missing, f"{document} names {missing}"


def test_every_finding_leads_to_a_section_of_troubleshooting() -> None:
    named, sections = anchors_of_findings(), anchors(REPOSITORY / "docs/troubleshooting.md")
    assert {"mount-wrong", "depth-scale", "no-objects"} <= named
    assert named <= sections, f"docs/troubleshooting.md lacks {sorted(named - sections)}"


def test_one_finds_where_to_change_what_by_names_that_are_there() -> None:
    rows, missing = rows_of_changes(), []
    for what, files, names in rows:
        missing += [f"{what}: {file}" for file in files if not file.is_file()]
        sources = "\n".join(file.read_text(encoding="utf-8") for file in files if file.is_file())
        missing += [f"{what}: {name}" for name in names if not re.search(rf"\b{re.escape(name)}\b", sources)]
    assert len(rows) >= 10 and not missing, f"ARCHITECTURE.md, section 7, names what is not there: {missing}"


def test_the_architecture_is_read_in_one_sitting() -> None:
    lines = text("ARCHITECTURE.md").count("\n")
    assert lines <= MOST_LINES, (
        f"ARCHITECTURE.md has {lines} lines, {MOST_LINES} at most; docs/ takes what is reference"
    )


def test_every_reason_of_a_refusal_is_in_the_reference_of_the_wire() -> None:
    assert names_in_table("## Why a closure is refused") == {reason.value for reason in Reason}


def test_every_reason_for_which_nothing_matched_is_there_too() -> None:
    assert names_in_table("## Why a frame or a constraint is dropped") >= {drop.value for drop in Drop}


def test_a_link_that_leads_nowhere_is_found() -> None:
    assert found("registration/no_such_file.py") is None and found("score/free_space.py") is not None
    assert "the-clock" in anchors(REPOSITORY / "docs/wire.md")
    assert "why-a-closure-is-refused" in anchors(REPOSITORY / "docs/wire.md")
