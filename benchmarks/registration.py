# SPDX-License-Identifier: Apache-2.0
"""Registration in the simulator, where the true pose is known: single objects, four objects, and what must be refused.

One object stands on a table in a room (a chair on the floor), and the camera goes around it by 0 to 180 degrees: right
is at most 5 degrees and 2 cm in the pose of the object, up to its symmetry. Four objects: right is the same of the
camera's motion at their middle, without that excuse. What must be refused is another instance of the same kind, or
another object, each in a room of its own. Beside ours, in the same run: the usual ways to register two object clouds.

    python benchmarks/registration.py --seed 7 --json registration.json
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click
import numpy as np
from paper import SUCCESS, TABLE_1, UP, Stage, keyframe

from objreg_ros.data import Array, DepthImage, Detections, Frame
from objreg_ros.geometry import inverse, pose, pose_error, transform, vector_from_rotation
from objreg_ros.registrar.candidate import Candidate
from objreg_ros.registrar.covariance import covariance_of
from objreg_ros.registrar.engine import Engine
from objreg_ros.registrar.gate import judge
from objreg_ros.registrar.keyframe import Keyframe
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registrar.symmetry import yaw_share
from objreg_ros.segmenter.params import SegmenterParams
from objreg_ros.segmenter.segment import Segmenter
from objreg_ros.simulation import furniture
from objreg_ros.simulation.light import looking
from objreg_ros.simulation.objects import make_object
from objreg_ros.simulation.params import StressParams
from objreg_ros.simulation.render import render
from objreg_ros.simulation.scene import furnished, number, place_on

CONDITIONS = {
    "clean": StressParams(),
    "stress": StressParams(depth_bias=0.003, warp=0.003, ragged=1.0, motion_blur=2.0),
}
FALSE = (8.0, 15.0)  # degrees and centimetres beyond which an accepted pose is a lie
FOUR = ("cereal_box", "book", "keyboard", "bowl", "cap", "flashlight", "soda_can")
SYMMETRIC = ("soda_can", "bowl")
TELLING = ("cereal_box", "chair", "monitor", "flashlight", "book", "keyboard")  # a cap tells next to nothing


@dataclass(frozen=True, eq=False)
class Shot:
    """One look: the camera's true pose and what the segmenter made of it."""

    T_world_camera: Array
    frame: Frame
    key: Keyframe


def look(stage: Stage, T_world_camera: Array, seed: int, stress: StressParams, params: RegistrarParams) -> Shot:
    """A picture of a stage with the true boxes of its objects."""
    image = render(stage.scene, T_world_camera, seed=seed, stress=stress)
    seen = [item for item in image.objects if item.visibility > 0.3]
    detections = Detections(
        xyxy=np.array([item.xyxy for item in seen], np.float32).reshape(-1, 4),
        score=np.ones(len(seen), np.float32),
        label=tuple(item.label for item in seen),
        image_hw=image.depth.shape,
        stamp_ns=seed,
    )
    depth = DepthImage(depth=image.depth, rgb=image.rgb, intrinsics=image.intrinsics, stamp_ns=seed)
    frame = Segmenter(SegmenterParams()).segment(detections, depth)
    return Shot(T_world_camera, frame, keyframe(frame, params))


def four(seed: int) -> Stage:
    """A table with four different objects; its middle is the object of the stage."""
    rng = np.random.default_rng([seed, 4])
    labels = rng.permutation(FOUR)[:4]
    table, room = furniture.table(rng, (1.3, 0.9)), furniture.room(rng, (3.2, 2.5))
    height = table.boards[0][2]
    corners = np.array([(-0.3, -0.2), (0.3, -0.2), (-0.3, 0.2), (0.3, 0.2)]) + rng.uniform(-0.05, 0.05, (4, 2))
    models = [make_object(str(label), int(rng.integers(2**31))) for label in labels]
    T_table = pose(np.eye(3), np.array([0.0, 0.0, height]))
    placed = [
        (model, place_on(model, T_table, x, y, float(rng.uniform(0, 2 * np.pi))))
        for model, (x, y) in zip(models, corners, strict=True)
    ]
    scene = furnished(rng, [(table, np.eye(4))], room).with_objects(number(placed))
    return Stage(scene, models[0], pose(np.eye(3), np.array([0.0, 0.0, height])), float(rng.uniform(0, 360)), 1.15)


def around(stage: Stage, angle: float, rng: np.random.Generator) -> Array:
    """``T_world_camera`` after going around a table by ``angle`` degrees; distance and aim differ a little."""
    azimuth, elevation = np.radians(stage.start_deg + angle), np.radians(38.0)
    away = np.array([np.cos(azimuth) * np.cos(elevation), np.sin(azimuth) * np.cos(elevation), np.sin(elevation)])
    centre = stage.T_world_object[:3, 3]
    aim = centre + rng.normal(0.0, 0.03, 3)
    return looking(centre + stage.distance * rng.uniform(0.9, 1.1) * away, aim, UP)


class Bench:
    """One condition: pairs that must be registered, pairs that must be refused."""

    def __init__(self, condition: str, seed: int) -> None:
        self.params = RegistrarParams()
        self.engine = Engine(self.params)
        self.stress, self.seed = CONDITIONS[condition], seed
        self._looks = 0
        self.rows: list[dict[str, Any]] = []
        self.joint: list[dict[str, Any]] = []
        self.negatives: list[bool] = []

    def single(self, label: str, number: int, angles: Sequence[float], peers: dict[str, Any]) -> Shot:
        """One object from all angles against the first; returns the first look."""
        stage = Stage.of(label, 1000 * self.seed + number)
        first = look(stage, stage.camera((0.0, 0.0, 0.0), self._hand()), self._noise(), self.stress, self.params)
        for angle in angles:
            second = look(stage, stage.camera((angle, 0.0, 0.0), self._hand()), self._noise(), self.stress, self.params)
            row = self.registered(first, second)
            T = row.pop("T")
            error = (180.0, 1e3) if T is None else stage.error(T, first.T_world_camera, second.T_world_camera)
            row["yaw_unknown"] = yaw_unknown(second, self.params)
            row |= {"label": label, "angle": angle, "error": error, "success": within(error, SUCCESS)}
            row["peers"] = {name: peer_row(peer, stage, first, second) for name, peer in peers.items()}
            self.rows.append(row)
        return first

    def together(self, number: int, angles: Sequence[float]) -> None:
        """Four objects from all angles against the first look."""
        stage = four(1000 * self.seed + number)
        first = look(stage, around(stage, 0.0, self._hand()), self._noise(), self.stress, self.params)
        for angle in angles:
            second = look(stage, around(stage, angle, self._hand()), self._noise(), self.stress, self.params)
            row = self.registered(first, second)
            T, truth = row.pop("T"), inverse(first.T_world_camera) @ second.T_world_camera
            middle = transform(inverse(second.T_world_camera), stage.T_world_object[:3, 3])
            error = (180.0, 1e3) if T is None else error_at(T, truth, middle)
            self.joint.append(row | {"angle": angle, "error": error, "success": within(error, SUCCESS)})

    def refuse(self, shots: Sequence[Shot], count: int) -> None:
        """Pairs of looks at different rooms: whatever is accepted is a lie."""
        rng = np.random.default_rng([self.seed, 9])
        for _ in range(count):
            i, j = rng.choice(len(shots), 2, replace=False)
            verdict = judge(self.engine.propose(shots[i].key, shots[j].key), self.params)
            self.negatives.append(isinstance(verdict, Candidate))

    def registered(self, first: Shot, second: Shot) -> dict[str, Any]:
        """The best pose ``T_first_second``, whether it is accepted, whether that is a lie, and how long it took."""
        start = time.perf_counter()
        candidates = self.engine.propose(second.key, first.key)
        verdict = judge(candidates, self.params)
        ms = 1e3 * (time.perf_counter() - start)
        accepted = isinstance(verdict, Candidate)
        best = verdict if isinstance(verdict, Candidate) else (candidates[0] if candidates else None)
        row: dict[str, Any] = {"T": None, "accepted": accepted, "false": False, "ms": ms, "nees": None}
        if best is not None:
            truth = inverse(first.T_world_camera) @ second.T_world_camera
            row["T"] = best.T_target_source
            row["pose_error"] = pose_error(best.T_target_source, truth)
            row["false"] = accepted and not within(row["pose_error"], FALSE)
            if accepted:
                row["nees"] = nees(best.T_target_source, truth, covariance_of(best.alignment, self.params))
        return row

    def figures(self) -> dict[str, Any]:
        """The figures of this condition."""
        rows, joint = self.rows, self.joint
        right = [row for row in rows if row["success"]]
        both = rows + joint
        spread = [row["nees"] for row in both if row["nees"] is not None and not row["false"]]
        return {
            "success": mean(rows, "success"),
            "success_90": mean([row for row in rows if row["angle"] <= 90], "success"),
            "by_object": grouped(rows, "label"),
            "by_angle": grouped(rows, "angle"),
            "joint_success": mean(joint, "success"),
            "rotation_deg": median([row["error"][0] for row in right]),
            "translation_cm": median([row["error"][1] for row in right]),
            "tried": len(both) + len(self.negatives),
            "false_accepted": sum(row["false"] for row in both) + sum(self.negatives),
            "recall_accepted": mean([row for row in both if row["success"]], "accepted"),
            "symmetry_recall": mean([row for row in rows if row["label"] in SYMMETRIC], "yaw_unknown"),
            "symmetry_false_alarm": mean([row for row in rows if row["label"] in TELLING], "yaw_unknown"),
            "false": [
                {key: row.get(key, "four") for key in ("label", "angle", "pose_error")} for row in both if row["false"]
            ],
            "nees_mean": float(np.mean(spread)) if spread else None,
            "ms_p50": float(np.percentile([row["ms"] for row in both], 50)),
            "ms_p95": float(np.percentile([row["ms"] for row in both], 95)),
            "peers": {
                name: mean([row["peers"][name] for row in rows], "success")
                for name in (rows[0]["peers"] if rows else ())
            },
        }

    def _hand(self) -> np.random.Generator:
        """The hand that holds the camera: another one for every look."""
        self._looks += 1
        return np.random.default_rng([self.seed, self._looks])

    def _noise(self) -> int:
        return int(self._hand().integers(2**31))


def yaw_unknown(shot: Shot, params: RegistrarParams) -> bool:
    """Whether the object of a look says itself that its yaw is not to be known."""
    if not shot.frame.objects or shot.frame.gravity is None:
        return False
    return yaw_share(shot.frame.objects[0], -shot.frame.gravity) < params.symmetry_share


def within(error: tuple[float, float], limit: tuple[float, float]) -> bool:
    """Whether an error is at most so many degrees and centimetres."""
    return error[0] <= limit[0] and error[1] <= limit[1]


def error_at(T: Array, truth: Array, point: Array) -> tuple[float, float]:
    """(degrees, centimetres that a point moves too far) of a pose."""
    degrees, _ = pose_error(T, truth)
    return degrees, float(100.0 * np.linalg.norm(transform(T, point) - transform(truth, point)))


def nees(T: Array, truth: Array, C: Array) -> float:
    """The error squared in units of its covariance; its mean is 6 for an honest covariance."""
    e = np.r_[truth[:3, 3] - T[:3, 3], vector_from_rotation(truth[:3, :3] @ T[:3, :3].T)]
    return float(e @ np.linalg.solve(C, e))


def mean(rows: Sequence[dict[str, Any]], key: str) -> float | None:
    """The share of rows that are so; None without rows."""
    return float(np.mean([row[key] for row in rows])) if rows else None


def median(values: Sequence[float]) -> float | None:
    """The median; None without values."""
    return float(np.median(values)) if values else None


def grouped(rows: Sequence[dict[str, Any]], key: str) -> dict[str, float | None]:
    """Success by a key."""
    return {
        str(value): mean([r for r in rows if r[key] == value], "success")
        for value in dict.fromkeys(r[key] for r in rows)
    }


Peer = Callable[[Array, Array], Array]


def peer_row(peer: Peer, stage: Stage, first: Shot, second: Shot) -> dict[str, Any]:
    """What a peer makes of the two clouds of the object."""
    if not first.frame.objects or not second.frame.objects:
        return {"success": False}
    T = peer(second.frame.objects[0].xyz.astype(float), first.frame.objects[0].xyz.astype(float))
    return {"success": within(stage.error(T, first.T_world_camera, second.T_world_camera), SUCCESS)}


def cloud_peers() -> dict[str, Peer]:
    """Usual ways to register two object clouds; each maps (source, target) to ``T_target_source``."""
    import open3d as o3d
    import small_gicp

    registration, near = o3d.pipelines.registration, 0.1

    def made(points: Array) -> Any:
        cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points)).voxel_down_sample(0.005)
        cloud.estimate_normals(o3d.geometry.KDTreeSearchParamHybrid(0.02, 30))
        cloud.orient_normals_towards_camera_location(np.zeros(3))
        return cloud

    def centred(source: Array, target: Array) -> Array:
        return pose(np.eye(3), target.mean(axis=0) - source.mean(axis=0))

    def icp(source: Array, target: Array) -> Array:
        result = registration.registration_icp(
            made(source), made(target), 1.0, np.eye(4), registration.TransformationEstimationPointToPoint()
        )
        return np.array(result.transformation)

    def plane(source: Array, target: Array) -> Array:
        start, error = centred(source, target), registration.TransformationEstimationPointToPlane()
        return np.array(registration.registration_icp(made(source), made(target), near, start, error).transformation)

    def gicp(source: Array, target: Array) -> Array:
        result = small_gicp.align(
            target, source, centred(source, target), downsampling_resolution=0.005, max_correspondence_distance=near
        )
        return np.array(result.T_target_source)

    def fpfh(source: Array, target: Array) -> Array:
        clouds = made(source), made(target)
        search = o3d.geometry.KDTreeSearchParamHybrid(0.05, 100)
        features = [registration.compute_fpfh_feature(cloud, search) for cloud in clouds]
        o3d.utility.random.seed(0)
        coarse = registration.registration_ransac_based_on_feature_matching(
            *clouds, *features, True, 0.01, registration.TransformationEstimationPointToPoint(False), 3,
            [registration.CorrespondenceCheckerBasedOnEdgeLength(0.9)],
            registration.RANSACConvergenceCriteria(50_000, 0.999),
        )  # fmt: skip
        result = small_gicp.align(
            target, source, coarse.transformation, downsampling_resolution=0.005, max_correspondence_distance=0.02
        )
        return np.array(result.T_target_source)

    return {"founding_icp": icp, "point_to_plane": plane, "small_gicp": gicp, "fpfh_ransac_gicp": fpfh}


@click.command()
@click.option("--seed", default=1, show_default=True)
@click.option("--json", "json_file", type=click.Path(dir_okay=False, path_type=Path), help="Write the figures here.")
@click.option("--quick", is_flag=True, help="Few objects and angles; ends within 50 s.")
@click.option("--reps", default=2, show_default=True, help="Instances of each object.")
def main(seed: int, json_file: Path | None, quick: bool, reps: int) -> None:
    """Register simulated objects and scenes, and refuse what is not the same."""
    start = time.perf_counter()
    angles = [0.0, 40.0, 90.0] if quick else [float(a) for a in range(0, 181, 10)]
    labels = ["cereal_box", "soda_can"] if quick else list(TABLE_1)
    out: dict[str, Any] = {"seed": seed}
    for condition in CONDITIONS:
        bench, peers = Bench(condition, seed), {} if quick else cloud_peers()
        shots = [bench.single(label, n, angles, peers) for label in labels for n in range(1 if quick else reps)]
        for n in range(1 if quick else 2 * reps):
            bench.together(n, angles[1:])
        bench.refuse(shots, 4 if quick else 500)
        out[condition] = bench.figures()
        click.echo(f"{condition}: {json.dumps({k: v for k, v in out[condition].items() if not isinstance(v, dict)})}")
    click.echo(f"{time.perf_counter() - start:.0f} s")
    if json_file is not None:
        json_file.write_text(json.dumps(out, indent=1))


if __name__ == "__main__":
    main()
