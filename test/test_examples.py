# SPDX-License-Identifier: Apache-2.0
"""The examples run as they are, each in a process of its own, and stay short."""

from __future__ import annotations

import ast
import json
import os
import re
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import cv2
import numpy as np
import pytest
from recording.sample_folders import tum_folder

from objreg_mapper.formats.tum import trajectory_text
from objreg_ros.data.images import Intrinsics
from objreg_ros.geometry import back_project, pose, rotation_from_vector
from objreg_ros.registration.gate.kinds import KINDS
from objreg_tools.report.exports.ply import write_ply
from objreg_tools.simulation.rendering.render import Rendering, render
from objreg_tools.simulation.scenarios import make_plan

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"
SAYS = {
    "pair.py": "accepted",
    "stream.py": "closed",
    "png_pair.py": "accepted",
    "ply_pair.py": "accepted",
    "own_detector.py": "masks: moved",
    "own_gate.py": "several: Reason.FEW_OBJECTS",
    "consume_constraints.py": "EDGE_SE3:QUAT 0 1",
    "objreg_to_gtsam.py": "solved: the second camera is at [0.1, 0.0, 0.02] m",
    "solve_g2o.py": "0.500000000 0.000000000 0.000000000 1.000000000",
    "replica_folder.py": "",
}
NEEDS = {
    "ply_pair.py": "open3d",
    "consume_constraints.py": "rclpy",
    "objreg_to_gtsam.py": "gtsam",
    "solve_g2o.py": "gtsam",
}
MOST_LINES = 40
MOST_BYTES = 400_000  # of the notebook with its pictures
PATIENCE_S = 900  # where every kernel has to be compiled first


def run(*arguments: str, text: str | None = None) -> str:
    """What a Python process prints; it must end well."""
    environment = {**os.environ, "PYTHONPATH": str(EXAMPLES.parent), "MPLBACKEND": "Agg"}
    done = subprocess.run(
        [sys.executable, *arguments], input=text, env=environment, capture_output=True, text=True, timeout=PATIENCE_S
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def shots() -> list[Rendering]:
    """Two pictures of a simulated room that lie a little beside each other."""
    plan = make_plan("orbit", seed=7, frames=120)
    return [render(plan.scenes[0], plan.T_world_camera[k], seed=k, threads=2) for k in (0, 8)]


def numbers(camera: Intrinsics, *names: str) -> list[str]:
    return [str(getattr(camera, name)) for name in names]


def draw_png(folder: Path) -> list[str]:
    """What `png_pair.py` is called with: pictures in files, depth in millimetres, and their camera."""
    files = []
    for k, shot in enumerate(shots()):
        assert shot.rgb is not None
        files += [str(folder / f"{kind}_{k}.png") for kind in ("rgb", "depth")]
        cv2.imwrite(files[-2], cv2.cvtColor(shot.rgb, cv2.COLOR_RGB2BGR))
        cv2.imwrite(files[-1], (1000 * shot.depth).round().astype(np.uint16))
    return [*files, *numbers(shot.intrinsics, "fx", "fy", "cx", "cy")]


def draw_ply(folder: Path) -> list[str]:
    """What `ply_pair.py` is called with: clouds in files without what was not measured, and their camera."""
    files = []
    for k, shot in enumerate(shots()):
        assert shot.rgb is not None
        camera, seen = shot.intrinsics, shot.depth > 0
        xyz = back_project(shot.depth, camera.fx, camera.fy, camera.cx, camera.cy)
        files.append(str(write_ply(folder / f"{k}.ply", xyz[seen], rgb=shot.rgb[seen])))
    return [*files, *numbers(camera, "fx", "fy", "cx", "cy", "width", "height")]


def draw_recording(folder: Path) -> list[str]:
    """What `replica_folder.py` is called with: a recording of three frames, and poses for two of them and for none."""
    path = [(0, pose(np.eye(3), np.array([1.0, 2.0, 3.0]))), (200_000_000, TURNED), (9_000_000_000, np.eye(4))]
    (folder / "path.txt").write_text(trajectory_text(path))
    return [str(tum_folder(folder / "tum")), str(folder / "path.txt"), str(folder / "out")]


TURNED = pose(rotation_from_vector(np.array([0.0, 0.0, np.pi / 2])), np.zeros(3))
DRAWN = {"png_pair.py": draw_png, "ply_pair.py": draw_ply, "replica_folder.py": draw_recording}


def skip_without(name: str) -> None:
    """Skip the example of this name where what it needs is not installed."""
    needed = NEEDS.get(name)
    if needed is not None and find_spec(needed) is None:
        pytest.skip(f"{name} needs {needed}, which is not installed")


def cells(kind: str) -> list[str]:
    """The cells of the notebook of one kind."""
    notebook = json.loads((EXAMPLES / "registration.ipynb").read_text(encoding="utf-8"))
    return ["".join(cell["source"]) for cell in notebook["cells"] if cell["cell_type"] == kind]


def test_each_example_is_known_here() -> None:
    assert {path.name for path in EXAMPLES.glob("*.py")} == set(SAYS)


@pytest.mark.parametrize("name", SAYS)
def test_an_example_is_short(name: str) -> None:
    assert len((EXAMPLES / name).read_text(encoding="utf-8").splitlines()) <= MOST_LINES


@pytest.mark.slow
@pytest.mark.parametrize("name", SAYS)
def test_an_example_runs_and_says_what_it_found(name: str, tmp_path: Path) -> None:
    skip_without(name)
    words = DRAWN[name](tmp_path) if name in DRAWN else []
    assert SAYS[name] in run(str(EXAMPLES / name), *words)


@pytest.mark.parametrize("name", ["png_pair.py", "ply_pair.py"])
def test_an_example_that_reads_files_says_how_it_is_called_and_what_a_file_lacks(name: str, tmp_path: Path) -> None:
    skip_without(name)
    files = [str(tmp_path / "none")] * (4 if name == "png_pair.py" else 2)
    for words, expected in [([], "FX FY CX CY"), ([*files, *["1"] * (8 - len(files))], "none: expected a")]:
        done = subprocess.run(
            [sys.executable, str(EXAMPLES / name), *words],
            env={**os.environ, "PYTHONPATH": str(EXAMPLES.parent)},
            capture_output=True,
            text=True,
            timeout=PATIENCE_S,
            check=False,
        )
        assert done.returncode == 1 and expected in done.stderr and "Traceback" not in done.stderr


def test_a_folder_in_the_layout_of_replica_reads_back_as_nvblox_reads_it(tmp_path: Path) -> None:
    """Frames are numbered from 0 without gaps, a pose is a line of 4 x 4, a line names one number of the camera."""
    run(str(EXAMPLES / "replica_folder.py"), *draw_recording(tmp_path))
    out = tmp_path / "out"
    T = np.loadtxt(out / "scene/traj.txt").reshape(-1, 4, 4)
    np.testing.assert_allclose(T, [pose(np.eye(3), np.array([1.0, 2.0, 3.0])), TURNED], atol=1e-8)
    camera = {}
    for line in (out / "cam_params.json").read_text().splitlines():
        known = [name for name in ("w", "h", "fx", "fy", "cx", "cy", "scale") if name in line]
        assert len(known) <= 1
        camera |= {name: float(line.split()[-1].rstrip(",")) for name in known}
    assert camera == {"w": 64, "h": 48, "fx": 50, "fy": 50, "cx": 31.5, "cy": 23.5, "scale": 1000}
    files = sorted(file.name for file in (out / "scene/results").iterdir())
    assert files == ["depth000000.png", "depth000001.png", "frame000000.jpg", "frame000001.jpg"]
    depth = cv2.imread(str(out / "scene/results/depth000001.png"), cv2.IMREAD_UNCHANGED)
    assert depth.dtype == np.uint16 and np.unique(depth).tolist() == [1200]
    assert cv2.imread(str(out / "scene/results/frame000001.jpg"))[0, 0] == pytest.approx([20, 0, 200], abs=4)


def test_a_path_without_a_picture_of_the_recording_is_refused(tmp_path: Path) -> None:
    words = draw_recording(tmp_path)
    (tmp_path / "path.txt").write_text(trajectory_text([(9_000_000_000, np.eye(4))]))
    with pytest.raises(AssertionError, match="expected stamps of pictures"):
        run(str(EXAMPLES / "replica_folder.py"), *words)


def test_the_notebook_is_one_and_is_small() -> None:
    path = EXAMPLES / "registration.ipynb"
    assert path.stat().st_size < MOST_BYTES
    assert cells("markdown") and cells("code")
    if find_spec("nbformat") is not None:
        import nbformat

        nbformat.validate(nbformat.read(path, as_version=4))


@pytest.mark.slow
def test_the_cells_of_the_notebook_run_in_their_order() -> None:
    assert "accepted" in run("-", text="\n".join(cells("code")))


def test_the_notebook_draws_evidence_by_the_names_that_it_has() -> None:
    (drawn,) = re.findall(r"names = (\(.*\))", "\n".join(cells("code")))
    assert set(ast.literal_eval(drawn)) <= {*KINDS, "inliers", "occluded", "violations", "overlap"}
