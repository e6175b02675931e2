# SPDX-License-Identifier: Apache-2.0
"""The import law of ARCHITECTURE.md, section 3, read off the tree."""

from __future__ import annotations

import ast
from collections import Counter
from functools import cache
from pathlib import Path

import pytest

from objreg_ros.registrar.params import RegistrarNodeParams, RegistrarParams

REPOSITORY = Path(__file__).resolve().parents[1]
PACKAGES = ("objreg_ros", "objreg_mapper", "objreg_tools")
STAGES = ("detector", "segmenter", "registrar", "blackbox")
# The registrar's own folders: each may import those before it, in the order in which a pair of keyframes goes.
FLOORS = (
    *("registration.params", "registration.labels", "registration.keyframe", "registration.candidate"),
    *("registration.kernels", "registration.shapes", "registration.prepare", "registration.score"),
    *("registration.refine", "registration.certainty", "registration.propose", "registration.gate"),
    *("registration", "keyframes", "memory", "registrar"),
)
ROS = {"rclpy", "launch", "launch_ros", "tf2_ros", "ament_index_python", "rosgraph_msgs"}
# The folders of bridge/: each may import those before it. What is in FREE_BRIDGE knows no ROS.
BRIDGE = ("bridge.messages", "bridge.process", "bridge.node", "bridge.camera", "bridge.streams")
FREE_BRIDGE = (
    *(f"bridge.messages.{name}" for name in ("layout", "masks", "pictures", "rvl", "headers")),
    *(f"bridge.messages.{name}from_msg" for name in ("", "camera_", "motion_", "vision_")),
    *("bridge.camera.calibration", "bridge.camera.calibration_files", "bridge.camera.camera_checks"),
    *("bridge.camera.camera_stream", "bridge.camera.chains", "bridge.camera.colour_frame", "bridge.camera.frames"),
    *("bridge.camera.lenses", "bridge.camera.mount", "bridge.camera.pace", "bridge.camera.registered_depth"),
    *("bridge.camera.travel", "bridge.streams.clock_monitor", "bridge.streams.sync", "bridge.streams.matching"),
)
FOR_ALL = ("limits", "sensor", "whole_file", "terminal", "share", "extra", "diagnostics", "native")
CORE = (*FOR_ALL, "data", "lens", "geometry", "params")
DRIVERS = tuple(f"objreg_tools.{name}" for name in ("offline", "rehearsal", "truth", "workers", "report", "merge"))


def module_name(path: Path) -> str:
    """The dotted name without a trailing __init__, below objreg_ros without it."""
    parts = list(path.relative_to(REPOSITORY).with_suffix("").parts)
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts).removeprefix("objreg_ros").lstrip(".")


MODULES = {
    module_name(path): path
    for package in PACKAGES
    for path in sorted((REPOSITORY / package).rglob("*.py"))
    if "__pycache__" not in path.parts
}


@cache
def imports(path: Path) -> set[str]:
    """Every module that a file imports, anywhere in it, by its absolute name."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import in line {node.lineno}"
            base = node.module or ""
            found |= {f"{base}.{alias.name}" for alias in node.names} if base.startswith(PACKAGES) else {base}
        elif isinstance(node, ast.Call) and ast.unparse(node.func) in (
            "import_module",
            "importlib.import_module",
            "extra.load",
        ):
            found |= {name.value for name in node.args[:1] if isinstance(name, ast.Constant)}
    return found


def own_imports(path: Path) -> set[str]:
    """The modules of this repository's packages that a file imports."""
    found = set()
    for name in imports(path):
        if name.startswith(PACKAGES):
            inner = name.removeprefix("objreg_ros").lstrip(".")
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
    if importer == "native":
        return imported == "native.sources"
    if imported in FOR_ALL and importer not in ("", *CORE):
        return True
    if below(importer, "objreg_tools"):
        return allowed_in_tools(importer, imported)
    if below(importer, "objreg_mapper"):
        if below(importer, "objreg_mapper.adapters"):
            return below(imported, "objreg_mapper", "bridge", *CORE) and imported != "objreg_mapper.node"
        if importer == "objreg_mapper.node":
            return not below(imported, "objreg_mapper.adapters") and below(
                imported, "objreg_mapper", "data", "bridge", "plausibility"
            )
        return below(imported, "objreg_mapper", "data", "geometry", "params") and not imported.endswith(".node")
    return allowed_in_ros(importer, imported)


def allowed_in_tools(importer: str, imported: str) -> bool:
    """What a module of the tools may import: the commands all; the rest no node."""
    if below(importer, "objreg_tools.cli"):
        return True
    if importer == "objreg_tools.__main__":
        return imported == "objreg_tools.cli"
    if importer == "objreg_tools.graph":  # all nodes in one process
        return imported in (
            *(f"{stage}.node" for stage in STAGES),
            *("keyframes.node", "objreg_mapper.node"),
            *("bridge.node.node_base", "bridge.process.intra_process", "bridge.node.spin"),
        )
    if below(importer, "objreg_tools.recording"):
        return below(imported, "objreg_tools.recording", "plausibility", "data", "lens", "geometry", *FREE_BRIDGE)
    if below(importer, "objreg_tools.simulation"):
        return below(imported, "objreg_tools.simulation", "objreg_tools.recording", "data", "geometry", "params")
    return below(
        imported,
        *(*STAGES, "objreg_mapper", "pipeline", "registration", "keyframes", "memory", "plausibility"),
        *(*CORE, "objreg_tools.recording", *DRIVERS, *FREE_BRIDGE),
    ) and not imported.endswith(".node")


def allowed_in_ros(importer: str, imported: str) -> bool:
    """What a module of the robot's package may import: nothing of the other two."""
    stage = importer.split(".")[0]
    if importer == "":  # what `import objreg_ros` offers, loaded when it is asked for
        return imported in ("library", "terminal")
    if below(importer, "data"):
        return below(imported, "data", "limits")
    if importer in CORE:
        return (
            imported == "limits"
            or (importer == "lens" and below(imported, "data"))
            or (importer == "params" and imported == "geometry")
        )
    if importer == "library":
        return below(imported, "detector", "segmenter", "registration", "keyframes", *CORE) and not imported.endswith(
            ".node"
        )
    if stage in STAGES and importer.endswith(".node"):
        return below(imported, stage, "data", "bridge", "share", "plausibility") or (
            (stage == "segmenter" and imported == "pipeline") or (stage == "registrar" and floor(imported) is not None)
        )
    if importer == "pipeline":
        return below(imported, "segmenter", "data", *FREE_BRIDGE) and not imported.endswith(".node")
    if importer == "keyframes.node":
        return below(imported, "keyframes", "memory", "registration", "data", "bridge", "share")
    if floor(importer) is not None:
        return below(imported, "data", "geometry", "params") or (
            imported not in ("registrar.node", "keyframes.node")
            and floor(imported) is not None
            and floor(imported) <= floor(importer)
        )
    if stage in STAGES:
        return below(imported, stage, "data", "geometry", "params")
    if stage == "plausibility":
        return below(imported, "plausibility", "data", "geometry")
    if importer in FREE_BRIDGE:
        return below(imported, "plausibility", "data", "lens", "geometry", *FREE_BRIDGE)
    if stage == "bridge":
        return below(imported, *BRIDGE[: step(importer) + 1], "plausibility", *CORE)
    return False


def may_use_ros(module: str) -> bool:
    of_adapters = (f"objreg_mapper.adapters.{name}" for name in ("diagnostics", "params", "rtabmap_nodes"))
    is_pure = module in (*FREE_BRIDGE, *of_adapters, "bridge.node.accounting", "bridge.node.common")
    speaks_ros = below(module, "objreg_tools.cli", "objreg_mapper.adapters", "bridge") and not is_pure
    return module.endswith(".node") or speaks_ros


def test_a_module_imports_only_what_the_law_allows() -> None:
    broken = {
        module: wrong
        for module, path in MODULES.items()
        if (wrong := sorted(name for name in own_imports(path) if not allowed(module, name)))
    }
    assert not broken, f"these may not import: {broken}; ARCHITECTURE.md, section 3"


def test_only_nodes_bridge_and_cli_know_ros() -> None:
    def of_ros(path: Path) -> list[str]:
        tops = {name.split(".")[0] for name in imports(path)}
        return sorted(top for top in tops if top in ROS or top.endswith(("_msgs", "_srvs")))

    broken = {module: ros for module, path in MODULES.items() if not may_use_ros(module) and (ros := of_ros(path))}
    assert not broken, f"only nodes, bridge/, adapters/ and cli/ may import of ROS: {broken}"


def test_onnxruntime_is_imported_in_one_file_only() -> None:
    users = [name for name, path in MODULES.items() if "onnxruntime" in {i.split(".")[0] for i in imports(path)}]
    assert len(users) == 1, f"onnxruntime is imported in {users}"


@pytest.mark.parametrize(
    ("library", "users"),
    [
        ("gtsam", {"objreg_mapper.optimisation.incremental"}),
        ("open3d", {"registration.paper", "segmenter.objects.paper", "segmenter.segment"}),
        ("matplotlib", {"objreg_tools.report.live_pictures"}),
        ("rerun", {"objreg_tools.report.exports.rerun_file"}),
        ("distributed", {"objreg_tools.workers"}),
        ("pyarrow", {"objreg_tools.report.batch.batch_tables"}),
        ("plotly", {"objreg_tools.report.bundle"}),
        ("prometheus_client", {"objreg_tools.cli.metrics.exposition"}),
    ],
)
def test_a_heavy_library_is_imported_only_where_it_is_used(library: str, users: set[str]) -> None:
    assert {name for name, path in MODULES.items() if library in {i.split(".")[0] for i in imports(path)}} <= users


def test_the_law_can_be_broken() -> None:
    assert not allowed("detector.detector", "segmenter.segment")
    assert not allowed("data.images", "geometry")
    assert not allowed("registrar.node", "objreg_mapper.node")
    assert not allowed("registrar.registrar", "objreg_tools.offline")
    assert not allowed("objreg_mapper.node", "objreg_tools.graph")
    assert not allowed("objreg_tools.offline", "registrar.node")
    assert not allowed("registrar.node", "geometry")
    assert not allowed("objreg_tools.graph", "segmenter.segment") and allowed("objreg_tools.graph", "segmenter.node")
    assert allowed("registrar.node", "bridge.messages.to_msg")
    assert allowed("objreg_mapper.adapters.g2o", "objreg_mapper.pose_graph") and not allowed(
        "objreg_mapper.adapters.g2o", "objreg_mapper.node"
    )
    assert not allowed("objreg_mapper.node", "objreg_mapper.adapters.g2o")
    assert (
        allowed("lens", "data.images")
        and not allowed("data.images", "lens")
        and not allowed("segmenter.segment", "lens")
    )
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


def test_files_and_folders_stay_small() -> None:
    """No file over 400 lines, no folder over 20 files, and no more than 32 parameters of the registrar."""
    lines = {name: len(path.read_text(encoding="utf-8").splitlines()) for name, path in MODULES.items()}
    assert {name: count for name, count in lines.items() if count > 400} == {}
    folders = Counter(path.parent for path in MODULES.values())
    assert {str(folder): count for folder, count in folders.items() if count > 20} == {}
    assert len(RegistrarParams.declarations()) + len(RegistrarNodeParams.declarations()) <= 32
