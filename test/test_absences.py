# SPDX-License-Identifier: Apache-2.0
"""What is not installed makes tests skip one by one, and a suite in which hardly a test ran fails."""

from __future__ import annotations

import ast
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

import pytest

TESTS = Path(__file__).resolve().parent
LAUNCH_TESTING = '''
import importlib.util


def pytest_pycollect_makemodule(module_path, parent):
    """As launch_testing's: it imports every file by itself, outside of what catches a failure."""
    spec = importlib.util.spec_from_file_location(module_path.stem, module_path)
    spec.loader.exec_module(importlib.util.module_from_spec(spec))
'''
ABSENT = "import torch\n\ndef test_it() -> None:\n    pass\n"
BROKEN = "import no_such_thing_at_all\n\ndef test_it() -> None:\n    pass\n"
GOOD = "def test_it() -> None:\n    pass\n"


def calls_at_import(body: list[ast.stmt]) -> Iterator[str]:
    """The calls that a file makes as it is imported, as they are written."""
    for statement in body:
        if isinstance(statement, ast.FunctionDef | ast.AsyncFunctionDef):
            continue
        inner = [getattr(statement, name, []) for name in ("body", "orelse", "finalbody")]
        if any(inner):
            for block in inner:
                yield from calls_at_import(block)
            for handler in getattr(statement, "handlers", []):
                yield from calls_at_import(handler.body)
        else:
            yield from (ast.unparse(node.func) for node in ast.walk(statement) if isinstance(node, ast.Call))


def test_no_file_skips_as_it_is_imported() -> None:
    for path in sorted(TESTS.rglob("*.py")):
        called = set(calls_at_import(ast.parse(path.read_text()).body))
        assert not called & {"pytest.importorskip", "pytest.skip", "importorskip", "skip"}, path


def suite(folder: Path, files: dict[str, str], *arguments: str) -> tuple[int, str]:
    """The exit status and the output of a session over a small suite with this suite's conftest.py."""
    (folder / "test").mkdir()
    shutil.copy(TESTS / "conftest.py", folder / "test/conftest.py")
    (folder / "pytest.ini").write_text("[pytest]\ntestpaths = test\naddopts = -q -rs -p no:cacheprovider\n")
    (folder / "as_launch_testing.py").write_text(LAUNCH_TESTING)
    (folder / "torch.py").write_text("raise ModuleNotFoundError('No module named torch', name='torch')\n")
    for name, text in files.items():
        (folder / "test" / name).write_text(text)
    environment = {name: value for name, value in os.environ.items() if name != "PYTEST_ADDOPTS"}
    environment |= {"PYTHONPATH": str(folder), "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"}
    said = subprocess.run(
        [sys.executable, "-m", "pytest", *arguments], cwd=folder, env=environment, capture_output=True, text=True
    )
    return said.returncode, said.stdout


def test_a_file_whose_imports_are_absent_is_one_skip_with_its_reason_and_the_others_run(tmp_path: Path) -> None:
    files = {"test_absent.py": ABSENT, "test_good.py": GOOD}
    status, said = suite(tmp_path, files, "-p", "as_launch_testing", "test")
    assert status == 0 and "1 passed, 1 skipped" in said
    assert "test_absent.py needs torch, which is not installed" in said


def test_an_import_of_what_is_not_optional_is_an_error(tmp_path: Path) -> None:
    status, said = suite(tmp_path, {"test_broken.py": BROKEN, "test_good.py": GOOD}, "test")
    assert status != 0 and "no_such_thing_at_all" in said


@pytest.mark.parametrize("files", [{}, {"test_absent.py": ABSENT}, {"test_good.py": GOOD}])
def test_a_whole_suite_in_which_hardly_a_test_ran_fails_as_colcon_understands_it(
    tmp_path: Path, files: dict[str, str]
) -> None:
    status, said = suite(tmp_path, files)
    assert status == pytest.ExitCode.USAGE_ERROR and "tests or more to run, got" in said


def test_a_choice_among_the_tests_is_not_counted(tmp_path: Path) -> None:
    assert suite(tmp_path, {"test_good.py": GOOD}, "-k", "it")[0] == 0


WORKER = "from pathlib import Path\nimport os\nimport pytest\n"
LIVE = f"""{WORKER}
@pytest.mark.ros
@pytest.mark.parametrize("number", range(9))
def test_it(number, domain) -> None:
    Path(f"live_{{os.environ['PYTEST_XDIST_WORKER']}}_{{domain}}").touch()
"""
OTHER = f"""{WORKER}
@pytest.mark.parametrize("number", range(4))
def test_it(number, domain) -> None:
    Path(f"other_{{os.environ['PYTEST_XDIST_WORKER']}}_{{domain}}").touch()
"""


@pytest.fixture
def workers() -> tuple[str, ...]:
    """The arguments that let two processes share the tests; the test skips where xdist is not installed."""
    if find_spec("xdist") is None:
        pytest.skip("pytest-xdist is not installed")
    return (
        "-p",
        "xdist.plugin",
        "--numprocesses",
        "2",
        "--dist",
        "loadfile",
        "--no-loadscope-reorder",
        "-o",
        "markers=ros",
    )


def test_live_graphs_are_one_workers_and_no_two_workers_share_a_domain(
    tmp_path: Path, workers: tuple[str, ...]
) -> None:
    live = {f"test_live_{number}.py": LIVE for number in range(3)}
    other = {f"test_other_{number}.py": OTHER for number in range(6)}
    status, said = suite(tmp_path, live | other, *workers, "test")
    assert status == 0 and "51 passed" in said
    by = {kind: {path.name.split("_", 1)[1] for path in tmp_path.glob(f"{kind}_*")} for kind in ("live", "other")}
    assert len(by["live"]) == 1
    domains = dict(one.split("_") for one in by["live"] | by["other"])
    assert len(domains) == len(set(domains.values())) == 2


def test_the_tests_of_all_workers_are_counted_together(tmp_path: Path, workers: tuple[str, ...]) -> None:
    files = {"test_absent.py": ABSENT, "test_good.py": GOOD, "test_good_too.py": GOOD}
    status, said = suite(tmp_path, files, *workers)
    assert status == pytest.ExitCode.USAGE_ERROR and said.count("1500 tests or more to run, got 2") == 1
    assert "1 skipped" in said and "test_absent.py needs torch, which is not installed" in said
