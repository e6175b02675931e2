# SPDX-License-Identifier: Apache-2.0
"""The container files: linted where hadolint is, pinned, without root, and made of files that are there."""

from __future__ import annotations

import re
import shutil
import subprocess
import tomllib
from pathlib import Path

import pytest

IMAGES = ("python", "ros")
AMD64, ARM64 = "ubuntu-24.04", "ubuntu-24.04-arm"  # runners of workflows


@pytest.fixture(params=IMAGES)
def dockerfile(request: pytest.FixtureRequest, repository: Path) -> Path:
    return repository / f"docker/{request.param}.Dockerfile"


def instructions(dockerfile: Path, name: str) -> list[str]:
    """What stands behind an instruction, each as one line."""
    text = re.sub(r"^#.*\n", "", dockerfile.read_text(), flags=re.M).replace("\\\n", " ")
    return re.findall(rf"^{name} (.+)$", text, re.M)


def test_hadolint_has_no_complaint(dockerfile: Path) -> None:
    hadolint = shutil.which("hadolint")
    if hadolint is None:
        pytest.skip("hadolint is not installed")
    done = subprocess.run([hadolint, dockerfile], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr


def test_an_image_comes_from_a_version_and_ends_without_root(dockerfile: Path) -> None:
    sources = [line.split() for line in instructions(dockerfile, "FROM")]
    stages = {words[-1] for words in sources if "AS" in words}
    bases = {words[0] for words in sources} - stages
    assert bases and all(":" in base and not base.endswith(":latest") for base in bases)
    last = dockerfile.read_text().rpartition("\nFROM ")[2]
    assert re.findall(r"^USER (.+)$", last, re.M)[-1:] == ["1000"]


def test_what_is_copied_is_there_and_sent_to_the_builder(repository: Path, dockerfile: Path) -> None:
    sent = Path(f"{dockerfile}.dockerignore").read_text().splitlines()
    copied = [line.split()[:-1] for line in instructions(dockerfile, "COPY") if "--from" not in line]
    wanted = {name for names in copied for name in names} - {"."}
    wanted |= {line[1:] for line in sent if line.startswith("!")}
    assert all(list(repository.glob(name)) for name in wanted)
    roots = {line[1:].partition("/")[0] for line in sent if line.startswith("!")}
    assert {name.partition("/")[0] for name in wanted} <= roots


def test_the_libraries_are_those_of_bootstrap(repository: Path) -> None:
    table = re.search(r"declare -A system_library=\((.+)\)", (repository / "scripts/bootstrap").read_text())
    assert table is not None
    installed = " ".join(instructions(repository / "docker/python.Dockerfile", "RUN")).split()
    assert set(re.findall(r"=(\S+)", table[1])) <= set(installed)


def test_a_workflow_builds_every_image_and_that_of_a_robot_on_arm64_too(repository: Path) -> None:
    workflow = (repository / ".github/workflows/images.yml").read_text()
    built = re.findall(r"- file: (\w+)\n +runner: (\S+)", workflow)
    assert sorted(built) == [("python", AMD64), ("ros", AMD64), ("ros", ARM64)]
    assert {path.name for path in (repository / "docker").glob("*.Dockerfile")} == {f"{n}.Dockerfile" for n in IMAGES}


def test_a_workflow_tests_the_robots_workspace_on_arm64_too(repository: Path) -> None:
    robot = (
        (repository / ".github/workflows/jazzy.yml").read_text().partition("\n  robot:\n")[2].partition("\n  arm64")[0]
    )
    assert f"runner: [{AMD64}, {ARM64}]" in robot and "runs-on: ${{ matrix.runner }}" in robot
    assert "colcon test" in robot


def test_a_workflow_builds_a_wheel_for_each_processor(repository: Path) -> None:
    workflow = (repository / ".github/workflows/wheels.yml").read_text()
    assert f"runner: [{AMD64}, {ARM64}]" in workflow and "cibuildwheel" in workflow
    settings = tomllib.loads((repository / "pyproject.toml").read_text())["tool"]["cibuildwheel"]
    assert settings["build"].startswith("cp311-") and "kernels(" in settings["test-command"]


def test_the_image_of_wheels_says_on_arm64_which_other_to_build(repository: Path) -> None:
    commands = instructions(repository / "docker/python.Dockerfile", "RUN")
    (check,) = [command for command in commands if "uname -m" in command]
    for processor, status in (("x86_64", 0), ("aarch64", 1)):
        machine = f"uname() {{ echo {processor}; }}; {check}"
        done = subprocess.run(["bash", "-o", "pipefail", "-c", machine], capture_output=True, text=True)
        assert done.returncode == status and ("docker/ros.Dockerfile" in done.stderr) == bool(status)


@pytest.mark.parametrize("name", IMAGES)
def test_the_lines_that_run_an_image_give_its_nodes_shared_memory(repository: Path, name: str) -> None:
    head = (repository / f"docker/{name}.Dockerfile").read_text().partition("\nFROM ")[0]
    assert "--shm-size=" in head and "--ipc=host" in head


@pytest.mark.parametrize("name", ["images", "jazzy", "wheels"])
def test_actions_are_pinned_by_their_commit_and_pip_by_hashes(repository: Path, name: str) -> None:
    workflow = (repository / f".github/workflows/{name}.yml").read_text()
    used = re.findall(r"uses: (\S+)(.*)", workflow)
    assert used and all(re.fullmatch(r"[\w/-]+@[0-9a-f]{40}", action) for action, _ in used)
    assert all(re.fullmatch(r"  # v\d+\.\d+\.\d+", version) for _, version in used)
    installs = re.findall(r"pip install (.*)", workflow)
    assert installs and all("--require-hashes" in words for words in installs) and "pipx" not in workflow


def test_what_pip_installs_into_an_image_has_its_hash(dockerfile: Path) -> None:
    commands = re.findall(r"pip install ([^&]*)", " ".join(instructions(dockerfile, "RUN")))
    own = [words for words in commands if words.split()[-1] == "."]
    assert len(commands) > len(own)
    assert all("--require-hashes" in words for words in commands if words not in own)
    assert all("--no-deps" in words for words in own)


def test_an_image_that_runs_has_no_compiler(repository: Path) -> None:
    text = (repository / "docker/python.Dockerfile").read_text()
    build, _, last = text.rpartition("\nFROM ")
    assert " g++" in build.rpartition("\nFROM ")[2] and "g++" not in last


def test_a_robots_image_has_the_solver_of_the_map(repository: Path) -> None:
    lock = (repository / "requirements/robot.lock").read_text()
    assert {"gtsam", "onnxruntime", "open3d", "rosbags"} <= set(re.findall(r"^([\w-]+)==", lock, re.M))
    assert not {"numba", "numpy", "scipy", "setuptools"} & set(re.findall(r"^([\w-]+)==", lock, re.M))


@pytest.mark.parametrize("name", ["build", "python3.12", "robot", "robot-test", "tools", "noble"])
def test_every_package_of_a_lock_has_hashes(repository: Path, name: str) -> None:
    lines = (repository / f"requirements/{name}.lock").read_text().replace("\\\n", " ").splitlines()
    packages = [line for line in lines if re.match(r"[\w-]+==", line)]
    assert packages and all("--hash=sha256:" in line for line in packages)


def test_a_workflow_looks_for_known_faults_in_what_images_and_robots_install(repository: Path) -> None:
    supply = (repository / ".github/workflows/jazzy.yml").read_text().partition("\n  supply:\n")[2]
    locks = re.search(r"for lock in (.+); do\n.+pip-audit .*--require-hashes", supply)
    assert locks is not None and {"build", "python3.12", "robot", "tools"} <= set(locks[1].split())
    assert all((repository / f"requirements/{lock}.lock").exists() for lock in locks[1].split())
