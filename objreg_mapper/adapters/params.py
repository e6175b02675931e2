# SPDX-License-Identifier: Apache-2.0
"""The parameters of the nodes that hand constraints to other mappers."""

from __future__ import annotations

from dataclasses import dataclass

from objreg_ros.params import MountedParams, Params, param


@dataclass(frozen=True)
class AdapterParams(Params):
    """Where constraints come from, and how many may wait."""

    input: str = param(
        "auto",
        "the topic of the constraints; auto: both, each constraint is taken once",
        choices=("auto", "loop_closures", "constraints"),
    )
    most_waiting: int = param(
        1000, "constraints that wait for their consumer; beyond it the oldest are dropped", ge=1, le=100_000
    )


@dataclass(frozen=True)
class BodyParams(MountedParams):
    """Where the camera sits on the body whose poses the consumer ties."""

    T_base_camera: tuple[float, ...] = param(
        (),
        "the camera's optical frame on the consumer's body: x y z qx qy qz qw; empty: as /tf_static says, for "
        "which constraints wait",
    )
    base_frame: str = param("base_link", "the consumer's body; what odometry says of its own counts more")


@dataclass(frozen=True)
class ToRtabmapParams(Params):
    """How constraints find the nodes of RTAB-Map."""

    max_offset: float = param(
        2.0, "a constraint is dropped where no node of RTAB-Map is nearer to one of its keyframes", unit="s", ge=0.001
    )
    patience: float = param(
        60.0, "a constraint waits so long for such nodes once RTAB-Map has sent any", unit="s", ge=0.1
    )
    answer_within: float = param(10.0, "an add_link that is not answered by then is asked again", unit="s", ge=0.1)
    most_attempts: int = param(5, "a constraint is dropped after so many without an answer", ge=1)


@dataclass(frozen=True)
class ToLioSamParams(Params):
    """What LIO-SAM can take."""

    least_seconds: float = param(
        30.0, "pairs of keyframes nearer than this are dropped: LIO-SAM's historyKeyframeSearchTimeDiff", "s", ge=0.0
    )
    period: float = param(1.0, "between two constraints: one over LIO-SAM's loopClosureFrequency", unit="s", ge=0.01)


@dataclass(frozen=True)
class ToHydraParams(Params):
    """Who we are to Hydra."""

    robot: int = param(0, "the number of the robot, as Hydra's robot_id", ge=0, le=25)


@dataclass(frozen=True)
class ToG2oParams(Params):
    """The file, and how dense its vertices are."""

    graph_path: str = param(
        "objreg.g2o", "where the graph is written; a second map goes beside it as objreg_1.g2o", at_start=True
    )
    period: float = param(5.0, "between two writings, where there is news", unit="s", ge=0.1)
    keyframe_translation: float = param(0.25, "motion after which odometry becomes a vertex", "m", ge=0.01)
    keyframe_rotation: float = param(15.0, "rotation after which odometry becomes a vertex", "deg", ge=0.1, le=180.0)
