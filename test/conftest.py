# SPDX-License-Identifier: Apache-2.0
"""Fixtures for every test, what becomes of a file whose imports are absent, and the count of what ran.

No file skips as it is imported: launch_testing's plugin, which comes with every ROS, turns one such skip into a skip of
the whole session.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Generator, Iterable
from functools import cache
from importlib.util import find_spec
from pathlib import Path

import pytest
from hypothesis import settings

# Examples are drawn anew on every desk and are the same in every CI run; no test is timed.
settings.register_profile("desk", deadline=None)
settings.register_profile("ci", deadline=None, derandomize=True)
settings.load_profile("ci" if os.environ.get("CI") else "desk")

# A model that somebody fetched for themselves changes no test.
os.environ["XDG_DATA_HOME"] = tempfile.mkdtemp(prefix="objreg_data_")

RUN_AT_LEAST = 1500  # of more than twice as many; without ROS, onnx, torch and recordings it is still fewer that skip
OPTIONAL = {"rclpy", "launch_ros", "onnx", "torch", "gtsam", "mkdocs", "rerun", "distributed", "pyarrow"}
OPTIONAL |= {"prometheus_client"}
if find_spec("rclpy") is None:  # messages are a part of ROS; beside an rclpy, a missing one is an error
    OPTIONAL |= {f"{name}_msgs" for name in ("diagnostic", "geometry", "nav", "sensor", "std", "visualization")}
    OPTIONAL |= {"builtin_interfaces", "rcl_interfaces", "rosgraph_msgs", "std_srvs"}

REPOSITORY = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="session")
def repository() -> Path:
    """The root of the checkout that is tested."""
    return REPOSITORY


@pytest.fixture(scope="session")
def domain() -> int:
    """The ROS domain of this process of tests."""
    return int(os.environ["ROS_DOMAIN_ID"])


@pytest.fixture(scope="session")
def shared() -> Path:
    """Real recordings and models beside the project; tests that need them skip where they are absent."""
    folder = Path(os.environ.get("OBJREG_SHARED", REPOSITORY.parent / "shared"))
    if not (folder / "data").is_dir():
        pytest.skip(f"no recordings at {folder}; set OBJREG_SHARED to the folder that holds data/ and models/")
    return folder


class Absence(pytest.Item):
    """Stands for the tests of a file that need what is not installed: one skip with its reason."""

    def runtest(self) -> None:
        pytest.skip(self.name)

    def reportinfo(self) -> tuple[Path, None, str]:
        return self.path, None, self.name


class File(pytest.Module):
    """A file of tests, which need not be able to import what is optional."""

    def collect(self) -> Iterable[pytest.Item | pytest.Collector]:
        try:
            return super().collect()
        except self.CollectError as error:
            missing = error.__cause__
            if not isinstance(missing, ModuleNotFoundError) or missing.name not in OPTIONAL:
                raise
        return [Absence.from_parent(self.parent, name=f"{self.path.name} needs {missing.name}, which is not installed")]


@pytest.hookimpl(tryfirst=True)  # before launch_testing's, which imports every file by itself
def pytest_pycollect_makemodule(module_path: Path, parent: pytest.Collector) -> pytest.Module | None:
    return None if module_path.name == "__init__.py" else File.from_parent(parent, path=module_path)


def _skipped_without_extra() -> Generator[None, object, object]:
    """A test that solves a map, or runs the founding method, skips where GTSAM or Open3D, extras, are not installed."""
    try:
        return (yield)
    except ValueError as error:
        absent = [name for name in ("gtsam", "open3d") if find_spec(name) is None and f"expected {name}" in str(error)]
        if absent:
            pytest.skip(str(error))
        raise


@pytest.hookimpl(wrapper=True)
def pytest_runtest_setup() -> Generator[None, object, object]:
    """Of the fixtures."""
    return (yield from _skipped_without_extra())


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call() -> Generator[None, object, object]:
    """Of the test itself."""
    return (yield from _skipped_without_extra())


class Count:
    """Fails a session of the whole suite in which hardly a test ran, and says so. Under xdist it counts all workers."""

    def __init__(self) -> None:
        self.ran = 0
        self.too_few = False

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        self.ran += report.when == "call" and not report.skipped

    @pytest.hookimpl(tryfirst=True)
    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        ended_well = session.exitstatus in (pytest.ExitCode.OK, pytest.ExitCode.NO_TESTS_COLLECTED)
        self.too_few = ended_well and is_whole(session.config) and self.ran < RUN_AT_LEAST
        if self.too_few:
            session.exitstatus = pytest.ExitCode.USAGE_ERROR  # colcon takes "no tests" for success

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        if self.too_few:
            terminalreporter.write_line(f"expected {RUN_AT_LEAST} tests or more to run, got {self.ran}", red=True)


def is_whole(config: pytest.Config) -> bool:
    """Whether every test is asked for: no path, no choice among the tests."""
    chosen = ("keyword", "markexpr", "deselect", "ignore", "ignore_glob", "lf", "stepwise", "collectonly")
    return config.args_source == config.ArgsSource.TESTPATHS and not any(
        config.getoption(name, None) for name in chosen
    )


def is_worker(config: pytest.Config) -> bool:
    """Whether xdist started this process to run a share of the tests for another, which counts them."""
    return hasattr(config, "workerinput")


def pytest_configure(config: pytest.Config) -> None:
    os.environ["ROS_DOMAIN_ID"] = str(domain_of(config))
    if not is_worker(config):
        config.pluginmanager.register(Count(), "count")


def domain_of(config: pytest.Config) -> int:
    """A ROS domain, 1 to 100, that no other worker of this run has, and other runs on this machine hardly."""
    if not is_worker(config):
        return 1 + os.getpid() % 100
    return 1 + (os.getppid() + int(config.workerinput["workerid"].removeprefix("gw"))) % 100


@cache
def turn(path: Path) -> int:
    """When a file's tests run where processes share them: first the live graphs, then what is slow, then the rest."""
    text = path.read_text() if path.is_file() else ""  # an absence is its folder's
    return 0 if "mark.ros" in text else 1 if "mark.slow" in text else 2


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    if is_worker(config):
        items.sort(key=lambda item: turn(item.path))


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: object) -> object:
    """Under `--dist loadfile` a file is one worker's, and all live graphs are: they take turns.

    `--dist loadgroup` would do it by marks, but not with pytest 9.2 (pytest-xdist, issue 1386).
    """
    if config.getoption("dist") != "loadfile":
        return None
    from xdist.scheduler import LoadScopeScheduling

    class Files(LoadScopeScheduling):
        def _split_scope(self, nodeid: str) -> str:
            file = nodeid.partition("::")[0]
            return "live graphs" if turn(config.rootpath / file) == 0 else file

    return Files(config, log)
