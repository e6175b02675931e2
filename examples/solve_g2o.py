# SPDX-License-Identifier: Apache-2.0
"""GTSAM reads what `objreg offline REC --g2o map.g2o` wrote, solves it and prints the keyframes as a TUM trajectory.

python solve_g2o.py map.g2o > keyframes.txt; without a file, of a small graph of its own.
"""

import csv
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

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
    for row in csv.DictReader(file.with_name(f"{file.name}.times.csv").open(encoding="utf-8")):
        pose, seconds = solved.atPose3(int(row["vertex"])), int(row["stamp_ns"]) * 1e-9
        q = pose.rotation().toQuaternion()
        print(f"{seconds:.6f}", *(f"{v:.6f}" for v in (*pose.translation(), q.x(), q.y(), q.z(), q.w())))


if __name__ == "__main__":
    with TemporaryDirectory() as folder:
        own = Path(folder, "map.g2o")
        own.write_text(SMALL, encoding="utf-8")
        Path(folder, "map.g2o.times.csv").write_text(TIMES, encoding="utf-8")
        solve(Path(sys.argv[1]) if len(sys.argv) > 1 else own)
