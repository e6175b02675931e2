# SPDX-License-Identifier: Apache-2.0
"""The names that each node may write, read, serve and call on the ROS graph. `objreg policy` writes them for SROS 2.

Names are those that a node gives: relative to its namespace, below the node itself (``~/``), or absolute.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, fields, replace

IMAGES = ("image", "image/compressed")
TF = ("tf", "tf_static")  # as the launch files remap /tf and /tf_static
ODOMETRY = ("odom", "odom/pose", "odom/pose_with_covariance")
FRAMES = ("labels", "objects", "view", "view/camera_info", "gravity", *ODOMETRY, *TF)
CLOSURES = ("constraints", "loop_closures")
EXCHANGED = ("summaries", "requests", "keyframes")
PARAMETERS = (
    *("~/describe_parameters", "~/get_parameter_types", "~/get_parameters", "~/list_parameters"),
    *("~/set_parameters", "~/set_parameters_atomically", "~/get_type_description"),
)
LIFE_CYCLE = (
    *("~/change_state", "~/get_state", "~/get_available_states"),
    *("~/get_available_transitions", "~/get_transition_graph"),
)
LOG = ("/rosout", "/parameter_events")
STAGES = ("detector", "segmenter", "registrar", "keyframer", "mapper")


@dataclass(frozen=True)
class Access:
    """Topics that are written and read, services that are served and called."""

    writes: tuple[str, ...] = ()
    reads: tuple[str, ...] = ()
    serves: tuple[str, ...] = ()
    calls: tuple[str, ...] = ()

    def __add__(self, other: Access) -> Access:
        kinds = (field.name for field in fields(self))
        return Access(*(tuple(dict.fromkeys(getattr(self, kind) + getattr(other, kind))) for kind in kinds))

    def renamed(self, rules: Mapping[str, str]) -> Access:
        """With the names that remaps give."""
        kinds = {field.name: getattr(self, field.name) for field in fields(self)}
        return replace(self, **{kind: tuple(rules.get(name, name) for name in names) for kind, names in kinds.items()})


PROCESS = Access(writes=LOG, reads=("/clock",), serves=PARAMETERS)  # what rclpy opens for any node
NODE = PROCESS + Access(writes=("/diagnostics", "finished"))
MANAGED = NODE + Access(writes=("~/transition_event",), serves=LIFE_CYCLE)
ADAPTER = NODE + Access(reads=CLOSURES)

NODES: dict[str, Access] = {
    "detector": MANAGED + Access(writes=("detections_table", "detections", "labels"), reads=IMAGES),
    "segmenter": MANAGED
    + Access(
        writes=("objects", "view", "view/camera_info", "gravity", "detections_3d", "labels"),
        reads=(
            *(*IMAGES, "points", "depth/image", "depth/image/compressedDepth", "camera_info", "colour/camera_info"),
            *("odom", "imu", *TF, "detections_table", "detections_in", "masks", "label_info", "labels"),
        ),
    ),
    "registrar": MANAGED
    + Access(
        writes=(
            *("transforms", "landmarks", *CLOSURES, "closure_refusals", "object_landmarks", "refusals", "acceptances"),
            *("markers", "relocalised", "initialpose", "localisation_state"),
        ),
        reads=FRAMES,
        serves=("~/relocalise", "~/where", "~/veto", "~/reset", "~/save", "~/enable"),
    ),
    "keyframer": MANAGED + Access(writes=("keyframes",), reads=FRAMES),
    "blackbox": MANAGED
    + Access(
        reads=(
            *(*IMAGES, "points", "depth/image", "depth/image/compressedDepth", "camera_info", "colour/camera_info"),
            *(*ODOMETRY, "imu", *TF, "detections_table", "detections_in", "masks", "label_info", "labels"),
            *("refusals", "acceptances", "constraints", "landmarks", "finished", "localisation_state"),
        ),
        serves=("~/write",),
        calls=tuple(f"{n}/{call}" for n in STAGES[:3] for call in ("list_parameters", "get_parameters")),
    ),
    "mapper": MANAGED
    + Access(
        writes=("path", "correction", "graph", "pruned", "tf"),
        reads=("odom", *TF, *CLOSURES),
        serves=("~/reset", "~/save", "~/enable"),
    ),
    "objreg_to_rtabmap": ADAPTER
    + Access(reads=("odom", "mapData"), calls=("rtabmap/add_link", "rtabmap/get_map_data")),
    "objreg_to_lio_sam": ADAPTER + Access(writes=("lio_loop/loop_closure_detection",)),
    "objreg_to_hydra": ADAPTER + Access(writes=("external_loop_closures",), reads=("odom",)),
    "objreg_to_g2o": ADAPTER + Access(reads=("odom",), serves=("~/save",)),
}
OWN = frozenset(name for access in NODES.values() for name in access.writes) - {*LOG, *TF}


def of_robots(robots: Mapping[str, Iterable[str]]) -> dict[str, Access]:
    """What registrar and mapper open besides for robots, each with the namespaces of its cameras, if it has several."""
    keyframers = [
        f"{robot}/{camera}/".replace("//", "/") for robot, names in robots.items() for camera in names or [""]
    ]
    odometry, closures = (tuple(f"{r}/{name}" for r in robots for name in names) for names in (("odom",), CLOSURES))
    return {
        "registrar": Access(reads=tuple(f"{at}{name}" for at in keyframers for name in ("keyframes", "labels"))),
        "mapper": Access(
            writes=tuple(f"{robot}/{name}" for robot in robots for name in ("path", "correction")),
            reads=odometry + closures,
        ),
    }


def of_exchange(namespace: str) -> Access:
    """What a registrar opens besides to exchange keyframes below a namespace."""
    topics = tuple(f"{namespace}/{name}" for name in EXCHANGED) if namespace else ()
    return Access(writes=topics, reads=topics)


def of_sources(nodes: Iterable[Access]) -> Access:
    """What camera, odometry and foreign detectors write for these nodes: all that they read and none of them writes."""
    read = dict.fromkeys(name for access in nodes for name in access.reads)
    return PROCESS + Access(writes=tuple(name for name in read if name not in OWN), reads=("finished",))


def expanded(names: Iterable[str], namespace: str, node: str) -> Iterator[str]:
    """The full names of a node's; ``namespace`` begins with a slash."""
    at = namespace.rstrip("/")
    for name in names:
        yield name if name.startswith("/") else f"{at}/{node}{name[1:]}" if name.startswith("~") else f"{at}/{name}"
