# SPDX-License-Identifier: Apache-2.0
"""What a run needs of a machine, one check each. None raises, and none needs what it checks for."""

from __future__ import annotations

import ctypes
import os
import platform
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from importlib import import_module
from importlib.metadata import packages_distributions
from importlib.metadata import version as version_of
from importlib.util import find_spec
from pathlib import Path

from objreg_ros import native, share
from objreg_ros.bridge.process.shared_memory import abandoned
from objreg_tools.report.run.about import commit, version

OLDEST_PYTHON = (3, 11)
LIBRARIES = {  # that Open3D loads, and the package of Debian and Ubuntu that has it
    "libusb-1.0.so.0": "libusb-1.0-0",
    "libGL.so.1": "libgl1",
    "libEGL.so.1": "libegl1",
    "libX11.so.6": "libx11-6",
}
NEEDED = (
    *("click", "cv2", "jinja2", "numpy", "onnxruntime"),
    *("PIL", "rosbags", "scipy", "tqdm", "yaml"),
)
EXTRAS = {  # module: the extra that brings it, and what for
    "distributed": ("batch", "many recordings at once"),
    "gtsam": ("mapper", "the mapper and corrected trajectories"),
    "matplotlib": ("report", "the demo's picture of the trajectory"),
    "open3d": ("paper", "the founding method, method: paper"),
    "plotly": ("report", "the views in 3D of a report"),
    "prometheus_client": ("metrics", "the metrics of a running graph, objreg metrics"),
    "rerun": ("rerun", "recordings for the Rerun viewer"),
}
LEAST_DISK_BYTES = 1 << 29
LEAST_SHARED_BYTES = 1 << 28  # three nodes, and three drivers with the 64 MiB of config/fastdds.xml
SHARED_MEMORY = Path("/dev/shm")


@dataclass(frozen=True, slots=True)
class Check:
    """One check: what it found, and ``todo`` where something is to be mended.

    ``stops`` is whether no run can work without it; else it is advice.
    """

    section: str
    name: str
    found: str
    todo: str = ""
    stops: bool = False


def all_checks(environment: Mapping[str, str] = os.environ) -> Iterator[Check]:
    """Every check, in the order of the output."""
    yield from of_package()
    yield from of_libraries()
    yield from of_modules()
    yield from of_extras()
    yield from of_models()
    yield from of_ros(environment)
    yield from of_machine()


def of_package() -> Iterator[Check]:
    """This package, Python and the system."""
    revision = commit(share.checkout())
    yield Check("system", "objreg_ros", f"{version() or 'of unknown version'}{f' ({revision})' if revision else ''}")
    is_old = sys.version_info < OLDEST_PYTHON
    todo = (
        f"install Python {'.'.join(map(str, OLDEST_PYTHON))} or newer and make the environment anew" if is_old else ""
    )
    yield Check("system", "Python", f"{platform.python_version()}, {sys.executable}", todo, is_old)
    yield Check("system", "platform", platform.platform())
    yield Check("system", "GPU", "none needed")


def of_libraries(libraries: Mapping[str, str] = LIBRARIES) -> Iterator[Check]:
    """The libraries of the system that Open3D loads, where it is installed."""
    if not _is_installed("open3d"):
        return
    for library, package in libraries.items():
        try:
            ctypes.CDLL(library)
        except OSError:
            yield Check("libraries", library, "absent", f"sudo apt-get install {package}", stops=True)
        else:
            yield Check("libraries", library, "there")


def of_modules(modules: Iterable[str] = NEEDED) -> Iterator[Check]:
    """The Python packages that every run needs: their versions, and whether they can be imported."""
    known = packages_distributions()
    for module in modules:
        trouble = _trouble_of_import(module)
        todo = f"run scripts/bootstrap again, or pip install --force-reinstall {share.NAME}" if trouble else ""
        yield Check("packages", module, trouble or _version(module, known), todo, stops=bool(trouble))


def of_extras(extras: Mapping[str, tuple[str, str]] = EXTRAS) -> Iterator[Check]:
    """What a run does without."""
    known = packages_distributions()
    for module, (extra, purpose) in extras.items():
        if not _is_installed(module):
            yield Check("extras", module, "absent", f"for {purpose}: pip install '{share.NAME}[{extra}]'")
        else:
            yield Check("extras", module, _version(module, known))


def _is_installed(module: str) -> bool:
    """Whether there is such a package; a folder of its name here, as in a checkout, is none."""
    spec = find_spec(module)
    return spec is not None and spec.origin is not None


def _trouble_of_import(module: str) -> str:
    try:
        import_module(module)
    except Exception as error:  # whatever a broken installation raises
        return f"{type(error).__name__}: {' '.join(str(error).split())}"
    return ""


def _version(module: str, known: Mapping[str, list[str]]) -> str:
    names = known.get(module, [])
    return version_of(names[0]) if names else "of unknown version"


def of_models() -> Iterator[Check]:
    """The detector's models: which is used unless another is asked for, and COCO's."""
    try:
        yield Check("models", "used by default", str(share.model(share.AUTO)))
    except OSError as error:
        yield Check("models", "used by default", str(error), "run scripts/bootstrap again", stops=True)
    coco = [name for name in share.COCO if (share.user_models() / name).is_file()]
    yield Check("models", "of COCO", ", ".join(coco) or "none", "" if coco else "for real rooms: objreg fetch-model")
    own = sorted(path.name for path in share.user_models().glob("*.onnx") if path.name not in share.COCO)
    yield Check("models", f"others in {share.user_models()}", ", ".join(own) or "none")


def of_ros(environment: Mapping[str, str]) -> Iterator[Check]:
    """ROS 2, which the live graph needs and `objreg offline` does not."""
    trouble = _trouble_of_import("rclpy")
    if trouble:
        todo = f"for the live graph: source ROS 2 Jazzy, or pip install '{share.NAME}[ros]'"
        yield Check("ROS", "rclpy", trouble, todo)
        return
    import rclpy

    distribution = environment.get("ROS_DISTRO")
    yield Check("ROS", "found", f"{distribution or 'wheels of Jazzy'}, {Path(str(rclpy.__file__)).parent}")
    yield _middleware(rclpy.get_rmw_implementation_identifier)
    yield Check("ROS", "profile", _profile(environment))
    for name in ("ROS_DOMAIN_ID", "ROS_AUTOMATIC_DISCOVERY_RANGE"):
        yield Check("ROS", name, environment.get(name, "not set"))
    has_own = _is_installed("objreg_msgs")
    todo = "" if has_own else "for closures with all their fields: build objreg_msgs with colcon"
    yield Check("ROS", "objreg_msgs", "there" if has_own else "absent: constraints alone", todo)


def _middleware(ask: Callable[[], str]) -> Check:
    try:
        return Check("ROS", "RMW", ask())
    except Exception as error:  # a library of another RMW that cannot be loaded
        return Check("ROS", "RMW", " ".join(str(error).split()), "for the live graph: unset RMW_IMPLEMENTATION")


def _profile(environment: Mapping[str, str]) -> str:
    from objreg_ros.bridge.process import profile

    try:
        return profile.apply(dict(environment))
    except OSError as error:
        return str(error)


def of_machine() -> Iterator[Check]:
    """Where files go, the build of the kernels, and shared memory."""
    for name, find in (("free disk here", Path.cwd), ("free disk for a while", tempfile.gettempdir)):
        yield free_disk(name, find)
    yield _shared_memory()
    yield compiled_code()


def free_disk(name: str, find: Callable[[], Path | str], least: int = LEAST_DISK_BYTES) -> Check:
    """How much fits into a folder; a full disk has none for what is temporary."""
    try:
        folder = find()
        free = shutil.disk_usage(folder).free
    except OSError as error:
        todo = "make room, or go to a folder that can be written, and name one as TMPDIR"
        return Check("machine", name, error.strerror or str(error), todo, stops=True)
    todo = f"make room: a run needs {least >> 20} MiB" if free < least else ""
    return Check("machine", name, f"{_size(free)} in {folder}", todo, stops=bool(todo))


def _shared_memory() -> Check:
    if not SHARED_MEMORY.is_dir():
        return Check("machine", "shared memory", "absent", "for the live graph: mount a tmpfs at /dev/shm")
    free = shutil.disk_usage(SHARED_MEMORY).free
    left = sum(abandoned(SHARED_MEMORY).values())
    todo = "for the live graph in a container: docker run --shm-size=1g, or --ipc=host"
    found = f"{_size(free)} free" + (f", {left >> 20} MiB of killed nodes, which the next node frees" if left else "")
    return Check("machine", "shared memory", found, todo if free + left < LEAST_SHARED_BYTES else "")


def compiled_code() -> Check:
    """Which build of the kernels this processor takes, and whether it is there."""
    name = "compiled kernels"
    try:
        native.kernels("tracking")
    except ImportError as error:
        return Check("machine", name, "cannot be loaded", " ".join(str(error).split()), stops=True)
    return Check("machine", name, native.chosen_build())


def _size(count: int) -> str:
    return f"{count / (1 << 30):.1f} GiB"
