# SPDX-License-Identifier: Apache-2.0
"""The import law of ARCHITECTURE.md, section 3, read off the tree."""

from __future__ import annotations

import ast
from collections import Counter
from pathlib import Path

import pytest

from objreg_ros.registration.params import RegistrarNodeParams, RegistrarParams

PACKAGE = Path(__file__).resolve().parents[1] / "objreg_ros"
STAGES = ("detector", "segmenter", "registrar", "mapper")
# The registrar's own folders: each may import those before it, in the order in which a pair of keyframes goes.
FLOORS = (
    *("registration.params", "registration.labels", "registration.keyframe", "registration.candidate"),
    *("registration.kernels", "registration.shapes", "registration.prepare", "registration.score"),
    *("registration.refine", "registration.certainty", "registration.propose", "registration.gate"),
    *("registration", "keyframes", "memory", "registrar"),
)
ROS = {"rclpy", "launch", "launch_ros", "tf2_ros", "ament_index_python", "rosgraph_msgs"}
# The folders of bridge/: each may import those before it. What is in FREE_BRIDGE knows no ROS.
BRIDGE = ("bridge.messages", "bridge.node", "bridge.camera", "bridge.streams")
FREE_BRIDGE = (
    *(f"bridge.messages.{name}" for name in ("from_msg", "layout", "masks", "pictures", "rvl", "vision_from_msg")),
    *("bridge.camera.calibration", "bridge.camera.calibration_files", "bridge.camera.camera_checks"),
    *("bridge.camera.camera_stream", "bridge.camera.chains", "bridge.camera.colour_frame", "bridge.camera.frames"),
    *("bridge.camera.lenses", "bridge.camera.mount", "bridge.camera.pace", "bridge.camera.registered_depth"),
    *("bridge.camera.travel", "bridge.streams.clock_monitor", "bridge.streams.sync"),
)
CORE = ("limits", "sensor", "whole_file", "terminal", "data", "lens", "geometry", "params", "share")
HOUSE = ("offline", "rehearsal", "truth", "report")


def module_name(path: Path) -> str:
    """The dotted name below objreg_ros, without a trailing __init__."""
    parts = list(path.relative_to(PACKAGE).with_suffix("").parts)
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {module_name(path): path for path in sorted(PACKAGE.rglob("*.py")) if "__pycache__" not in path.parts}


def imports(path: Path) -> set[str]:
    """Every module that a file imports, anywhere in it, by its absolute name."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import in line {node.lineno}"
            base = node.module or ""
            found |= {f"{base}.{alias.name}" for alias in node.names} if base.startswith("objreg_ros") else {base}
        elif isinstance(node, ast.Call) and ast.unparse(node.func).split(".")[-1] == "import_module":
            found |= {word.value for word in node.args[:1] if isinstance(word, ast.Constant)}
    return found


def own_imports(path: Path) -> set[str]:
    """The modules of this package that a file imports, below objreg_ros."""
    found = set()
    for name in imports(path):
        if name.startswith("objreg_ros."):
            inner = name.removeprefix("objreg_ros.")
            found.add(inner if inner in MODULES else inner.rpartition(".")[0])
    return found - {""}


def below(name: str, *packages: str) -> bool:
    return any(name == package or name.startswith(package + ".") for package in packages)


def floor(module: str) -> int | None:
    """The number of the floor that a module of the registrar's folders is on; None for any other."""
    return next((k for k, name in enumerate(FLOORS) if below(module, name)), None)


def step(module: str) -> int:
    """The number of the folder of bridge/ that a module is in."""
    return next(k for k, name in enumerate(BRIDGE) if below(module, name))


def allowed(importer: str, imported: str) -> bool:
    """The table of the import law."""
    room = importer.split(".")[0]
    if imported in ("limits", "sensor", "whole_file", "terminal") and importer != "":
        return True
    if importer == "":  # what `import objreg_ros` offers, loaded when it is asked for
        return imported in ("library", "kernel_cache")
    if importer in CORE:
        return (importer, imported) in (("lens", "data"), ("params", "geometry"))
    if importer == "library":
        return below(imported, "detector", "segmenter", "registration", "keyframes", *CORE) and not imported.endswith(
            ".node"
        )
    if below(importer, "cli"):
        return True
    if importer == "__main__":
        return imported == "cli"
    if importer == "graph":  # all nodes in one process
        return imported in (
            *(f"{room}.node" for room in STAGES),
            "keyframes.node",
            "bridge.node.node_base",
            "bridge.node.intra_process",
            "bridge.node.spin",
        )
    if room in STAGES and importer.endswith(".node"):
        return below(imported, room, "data", "bridge", "share", "plausibility") or (
            room == "registrar" and floor(imported) is not None
        )
    if importer == "keyframes.node":
        return below(imported, "keyframes", "memory", "registration", "data", "bridge", "share")
    if floor(importer) is not None:
        return below(imported, "data", "geometry", "params") or (
            imported not in ("registrar.node", "keyframes.node")
            and floor(imported) is not None
            and floor(imported) <= floor(importer)
        )
    if room in STAGES:
        return below(imported, room, "data", "geometry", "params")
    if room == "adapters":
        return below(imported, "adapters", "mapper", "bridge", *CORE) and imported != "mapper.node"
    if room == "plausibility":
        return below(imported, "plausibility", "data", "geometry")
    if importer in FREE_BRIDGE:
        return below(imported, "plausibility", "data", "lens", "geometry", *FREE_BRIDGE)
    if room == "bridge":
        return below(imported, *BRIDGE[: step(importer) + 1], "plausibility", *CORE)
    if room == "recording":
        return below(imported, "recording", "plausibility", "data", "lens", "geometry", *FREE_BRIDGE)
    if room == "simulation":
        return below(imported, "simulation", "recording", "data", "geometry", "params")
    if room in HOUSE:
        return below(
            imported,
            *(*STAGES, "registration", "keyframes", "memory", "plausibility", "recording"),
            *(*CORE, *HOUSE, *FREE_BRIDGE),
        ) and not imported.endswith(".node")
    return False


def may_use_ros(module: str) -> bool:
    is_pure = module in (*FREE_BRIDGE, "adapters.params", "adapters.rtabmap_nodes")
    return module.endswith(".node") or (below(module, "cli", "adapters", "bridge") and not is_pure)


@pytest.mark.parametrize("module", sorted(MODULES))
def test_a_module_imports_only_what_the_law_allows(module: str) -> None:
    broken = sorted(name for name in own_imports(MODULES[module]) if not allowed(module, name))
    assert not broken, f"objreg_ros.{module} may not import {broken}: ARCHITECTURE.md, section 3"


@pytest.mark.parametrize("module", sorted(MODULES))
def test_only_nodes_bridge_and_cli_know_ros(module: str) -> None:
    ros = sorted(
        n for n in imports(MODULES[module]) if n.split(".")[0] in ROS or n.split(".")[0].endswith(("_msgs", "_srvs"))
    )
    assert may_use_ros(module) or not ros, f"objreg_ros.{module} imports {ros}: only nodes, bridge/ and cli/ may"


def test_onnxruntime_is_imported_in_one_file_only() -> None:
    users = [name for name, path in MODULES.items() if "onnxruntime" in {i.split(".")[0] for i in imports(path)}]
    assert len(users) == 1, f"onnxruntime is imported in {users}"


@pytest.mark.parametrize(
    ("library", "users"),
    [
        ("gtsam", {"mapper.incremental"}),
        ("open3d", {"registration.paper", "segmenter.objects.paper"}),
        ("matplotlib", {"report.run.live_pictures"}),
        ("rerun", {"report.exports.rerun_file"}),
        ("distributed", {"workers"}),
        ("pyarrow", {"report.batch.batch_tables"}),
        ("plotly", {"report.bundle"}),
    ],
)
def test_a_heavy_library_is_imported_only_where_it_is_used(library: str, users: set[str]) -> None:
    assert {name for name, path in MODULES.items() if library in {i.split(".")[0] for i in imports(path)}} <= users


def test_the_law_can_be_broken() -> None:
    assert not allowed("detector.detector", "segmenter.segment")
    assert not allowed("data", "geometry")
    assert not allowed("offline", "registrar.node")
    assert not allowed("registrar.node", "geometry")
    assert not allowed("graph", "segmenter.segment") and allowed("graph", "segmenter.node")
    assert allowed("registrar.node", "bridge.messages.to_msg")
    assert allowed("adapters.g2o", "mapper.pose_graph") and not allowed("adapters.g2o", "mapper.node")
    assert not allowed("mapper.node", "adapters.g2o")
    assert allowed("lens", "data") and not allowed("data", "lens") and not allowed("segmenter.segment", "lens")
    assert not allowed("registration.score.view_score", "registration.refine.batch_icp")
    assert not allowed("registration.propose.shortlist", "memory.store")
    assert not allowed("memory.store", "registrar.registrar")
    assert not allowed("", "registrar.registrar")
    assert not allowed("bridge.messages.to_msg", "bridge.node.qos") and allowed(
        "bridge.node.node_base", "bridge.messages.to_msg"
    )
    assert not allowed("library", "memory.store")
    assert not allowed("library", "detector.node")
    assert allowed("registration.refine.batch_icp", "registration.score.view_score")


def test_the_rooms_that_followed_the_registrar_stay_small() -> None:
    """No file over 300 lines, no folder over 16 files, and no more than 31 parameters."""
    files = [path for name, path in MODULES.items() if below(name, "registration", "keyframes", "memory", "registrar")]
    assert {path.name for path in files if len(path.read_text(encoding="utf-8").splitlines()) > 300} == set()
    assert max(Counter(path.parent for path in files).values()) <= 16
    assert len(RegistrarParams.declarations()) + len(RegistrarNodeParams.declarations()) <= 31
