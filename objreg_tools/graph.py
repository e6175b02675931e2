# SPDX-License-Identifier: Apache-2.0
"""All nodes in one process: ``objreg_graph [detector] [segmenter] [registrar] [mapper] --ros-args …``.

Without names it runs detector, segmenter and registrar. No picture and no cloud between them goes through DDS: each
node passes its results to the next one in memory. A topic is published as well where it has a subscriber. A parameter
or a remap for one node bears its name: ``-p detector:threshold:=0.4``.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from functools import partial

from objreg_mapper.node import MapperNode
from objreg_ros.bridge.node.node_base import NodeBase
from objreg_ros.bridge.node.spin import run_together
from objreg_ros.bridge.process.intra_process import IntraProcessBus
from objreg_ros.detector.node import DetectorNode
from objreg_ros.keyframes.node import KeyframerNode
from objreg_ros.registrar.node import RegistrarNode
from objreg_ros.segmenter.node import SegmenterNode

# In the order in which a frame comes to them: who offers a topic is made before who listens to it.
NODES: dict[str, Callable[[IntraProcessBus], NodeBase]] = {
    "detector": DetectorNode,
    "segmenter": SegmenterNode,
    "registrar": RegistrarNode,
    "keyframer": KeyframerNode,
    "mapper": MapperNode,
}
STAGES = ("detector", "segmenter", "registrar")


def chosen(arguments: Sequence[str]) -> list[str]:
    """The nodes that a command line asks for, in order; ends the process with status 2 for one that there is not."""
    own = list(arguments[: arguments.index("--ros-args")] if "--ros-args" in arguments else arguments)
    parser = argparse.ArgumentParser("objreg_graph", description="The nodes of objreg_ros in one process.")
    parser.add_argument("nodes", nargs="*", metavar="node", help=f"of {', '.join(NODES)}; the first three if none")
    asked = parser.parse_args(own).nodes or STAGES
    for name in asked:
        if name not in NODES:
            parser.error(f"expected nodes of {', '.join(NODES)}, got {name}")
    return [name for name in NODES if name in asked]


def main() -> int:
    """The executable ``objreg_graph``."""
    bus = IntraProcessBus()
    return run_together([partial(NODES[name], bus) for name in chosen(sys.argv[1:])])


if __name__ == "__main__":
    sys.exit(main())
