# SPDX-License-Identifier: Apache-2.0
"""One description for both ways: an ament_python package for colcon, and a pip package."""

import os
import platform
import runpy
from glob import glob
from pathlib import Path

from setuptools import Extension, find_packages, setup
from setuptools.command.build_py import build_py

NAME = "objreg_ros"
PACKAGES = ("objreg_ros", "objreg_mapper", "objreg_tools")
HOME = "https://objreg-ros.invalid"  # where the repository is hosted


def files_below(folder: str) -> list[tuple[str, list[str]]]:
    """The data_files of a folder and all its subfolders."""
    return [
        (os.path.join("share", NAME, root), [os.path.join(root, name) for name in sorted(names)])
        for root, _, names in os.walk(folder)
        if names
    ]


class BuildPython(build_py):
    """Leaves no header of an earlier build among what is installed: a kernel's build is marked with all of them."""

    def run(self) -> None:
        """Remove what an older source left, then copy as usual."""
        root = Path(__file__).resolve().parent
        for path in Path(self.build_lib).rglob("native/*.?pp"):
            if not (root / path.relative_to(self.build_lib)).exists():
                path.unlink()
        super().run()


def kernels() -> list[Extension]:
    """The builds of the kernels, as `objreg_ros.native` has them, on Python's stable interface."""
    root = Path(__file__).resolve().parent
    sources = runpy.run_path(str(root / NAME / "native" / "sources.py"))
    files = [str(path.relative_to(root)) for path in sources["source_files"](root)]
    # Sums in any order, as the processor's vectors take them; NaN and infinity stay what they are.
    fast = ["-fno-math-errno", "-fno-trapping-math", "-fno-signed-zeros", "-fassociative-math", "-freciprocal-math"]
    builds = {"plain": ["-O3", *fast]}
    if platform.machine() == "x86_64":
        builds["fast"] = ["-O3", *fast, "-march=x86-64-v3"]
    if os.environ.get("OBJREG_CHECKED"):
        builds["checked"] = ["-O1", "-DOBJREG_CHECKED"]
    return [
        Extension(
            f"{NAME}.native.{build}",
            [f"{NAME}/native/{build}.cpp"],
            depends=files,
            include_dirs=["."],
            define_macros=[("SOURCES", sources["fingerprint"](root))],
            extra_compile_args=["-std=c++17", "-fvisibility=hidden", "-ffp-contract=fast", "-g0", *flags],
            extra_link_args=["-Wl,-s"],
            language="c++",
            py_limited_api=True,
        )
        for build, flags in builds.items()
    ]


setup(
    name=NAME,
    version="0.3.0",
    description="Object-level loop closure for ROS 2: detect, segment, register, and say no",
    long_description=Path(__file__).resolve().with_name("README.md").read_text(encoding="utf-8"),
    long_description_content_type="text/markdown",
    license="Apache-2.0",
    license_files=["LICENSE"],
    url=HOME,
    project_urls={
        "Source": f"{HOME}/source",
        "Documentation": f"{HOME}/docs",
        "Changelog": f"{HOME}/source/CHANGELOG.md",
        "Issues": f"{HOME}/issues",
    },
    keywords=["ros2", "slam", "loop-closure", "point-cloud", "registration", "rgb-d"],
    classifiers=[
        "Development Status :: 4 - Beta",
        "Intended Audience :: Developers",
        "Intended Audience :: Science/Research",
        "Operating System :: POSIX :: Linux",
        "Programming Language :: Python :: 3",
        "Programming Language :: Python :: 3.11",
        "Programming Language :: Python :: 3.12",
        "Topic :: Scientific/Engineering :: Image Recognition",
        "Typing :: Typed",
    ],
    maintainer="objreg_ros maintainers",
    maintainer_email="maintainers@objreg-ros.invalid",
    packages=find_packages(include=[*PACKAGES, *(f"{package}.*" for package in PACKAGES)]),
    package_data={package: ["py.typed", "report/templates/*", "**/native/*.?pp"] for package in PACKAGES},
    cmdclass={"build_py": BuildPython},
    ext_modules=kernels(),
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml", "LICENSE"]),
        (f"share/{NAME}/launch", glob("launch/*.launch.py")),
        *files_below("config"),
        *files_below("models"),
    ],
    python_requires=">=3.11",
    # What the robot's nodes and the library need: objreg_ros, and objreg_mapper but for its solver.
    install_requires=[
        "setuptools",
        "numpy>=1.26",
        "onnxruntime>=1.17",
        "opencv-python-headless>=4.6",
        "pillow>=9.4",
        "pyyaml>=6",
        "scipy>=1.11",
    ],
    extras_require={
        # objreg_tools: the command `objreg`, recordings, reports, the simulator.
        "tools": ["click>=8.1", "jinja2>=3.1", "rosbags>=0.11", "tqdm>=4.64"],
        # The founding method, `method: paper`, is Open3D's ICP.
        "paper": ["open3d>=0.18"],
        # The mapper, and the corrected trajectory of a report. Its wheel asks for pytest 9, which the launch_testing of
        # Ubuntu does not go with: on a robot, `pip install --no-deps gtsam`.
        "mapper": ["gtsam>=4.3"],
        # The 3D parts of a report, and the demo's picture of the trajectory. Without it the report has its flat
        # pictures, and says so.
        "report": ["matplotlib>=3.6", "plotly>=5.9"],
        # `objreg batch`: Dask's processes and clusters, and Parquet.
        "batch": ["distributed>=2024.1", "pyarrow>=14"],
        # `objreg metrics`: a running graph for Prometheus.
        "metrics": ["prometheus_client>=0.20"],
        # `--rerun`: a run as a recording for the Rerun viewer.
        "rerun": ["rerun-sdk>=0.23"],
        # The site of the documentation: `mkdocs build`.
        "docs": ["mkdocs-material>=9.5", "mkdocstrings-python>=1.10"],
        # The real ROS 2 Jazzy as wheels, for machines without a ROS installation.
        "ros": ["ros-jazzy-rclpy", "ros-jazzy-common-interfaces", "ros-jazzy-rmw-fastrtps-cpp"],
        "test": [
            "axe-core-python",
            "hypothesis",
            "mypy",
            "onnx",
            "pytest",
            "pytest-xdist",
            "ruff",
            "selenium>=4.11",
            "small_gicp>=1.0",
        ],
    },
    entry_points={
        "console_scripts": [
            "objreg = objreg_tools.__main__:main",
            "objreg_graph = objreg_tools.graph:main",
            "detector = objreg_ros.detector.node:main",
            "segmenter = objreg_ros.segmenter.node:main",
            "registrar = objreg_ros.registrar.node:main",
            "blackbox = objreg_ros.blackbox.node:main",
            "keyframer = objreg_ros.keyframes.node:main",
            "mapper = objreg_mapper.node:main",
            "objreg_to_rtabmap = objreg_mapper.adapters.rtabmap:main",
            "objreg_to_lio_sam = objreg_mapper.adapters.lio_sam:main",
            "objreg_to_hydra = objreg_mapper.adapters.hydra:main",
            "objreg_to_g2o = objreg_mapper.adapters.g2o:main",
        ],
    },
    options={"build_ext": {"parallel": 2}, "bdist_wheel": {"py_limited_api": "cp311"}},
    zip_safe=False,
)
