# SPDX-License-Identifier: Apache-2.0
"""GTSAM reads what `objreg offline REC --g2o map.g2o` wrote, solves it and prints the keyframes as a TUM trajectory.

python solve_g2o.py map.g2o > keyframes.txt; without a file, of a small graph of its own.
"""

import csv
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from objreg_mapper.formats.tum import trajectory_text

try:
    import gtsam
except ImportError:
    raise SystemExit("expected gtsam, got none: pip install gtsam") from None

SMALL = """VERTEX_SE3:QUAT 0 0 0 0 0 0 0 1
VERTEX_SE3:QUAT 1 0 0 1.2 0 0 0 1
EDGE_SE3:QUAT 0 1 0 0 1 0 0 0 1 100 0 0 0 0 0 100 0 0 0 0 100 0 0 0 100 0 0 100 0 100
"""
TIMES = "vertex,stamp_ns,session\n0,0,0\n1,500000000,0\n"


def solve(file: Path) -> None:
    """Vertex 0 stays; edges that the others contradict weigh little (Huber)."""
    graph, poses = gtsam.readG2o(str(file), True, gtsam.KernelFunctionType.KernelFunctionTypeHUBER)
    graph.add(gtsam.PriorFactorPose3(0, poses.atPose3(0), gtsam.noiseModel.Isotropic.Sigma(6, 1e-6)))
    solved = gtsam.LevenbergMarquardtOptimizer(graph, poses).optimize()
    rows = csv.DictReader(file.with_name(f"{file.name}.times.csv").open(encoding="utf-8"))
    path = [(int(row["stamp_ns"]), solved.atPose3(int(row["vertex"])).matrix()) for row in rows]
    print(trajectory_text(path), end="")


if __name__ == "__main__":
    with TemporaryDirectory() as folder:
        for name, text in (("map.g2o.times.csv", TIMES), ("map.g2o", SMALL)):
            Path(folder, name).write_text(text, encoding="utf-8")
        solve(Path(sys.argv[1] if len(sys.argv) > 1 else Path(folder, "map.g2o")))
