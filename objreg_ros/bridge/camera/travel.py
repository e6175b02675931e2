# SPDX-License-Identifier: Apache-2.0
"""Odometry out of the messages of /tf."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from objreg_ros.bridge.camera.chains import moved, odometry_edge
from objreg_ros.bridge.camera.frames import FrameEdge, FrameTree
from objreg_ros.bridge.messages import motion_from_msg
from objreg_ros.data.frames import Odometry


class Travel:
    """The samples of the edge above ``camera`` that is odometry (`odometry_edge`); none before that is known.

    ``tree`` has taken in a message before it comes here. The edge that was found stays until the camera is another.
    """

    def __init__(self, tree: FrameTree, outright: bool = False) -> None:
        self.outright, self.camera = outright, ""
        self._tree = tree
        self._edge: FrameEdge | None = None
        self._of = ""  # the camera that the edge is of

    def of(self, message: Any) -> Iterator[Odometry]:
        """The odometry in a TFMessage; ValueError for a sample that is none."""
        if self._of != self.camera or self._edge is None:
            self._of = self.camera
            self._edge = odometry_edge(self._tree, self.camera, self.outright) if self.camera else None
        if self._edge is not None:
            yield from map(motion_from_msg.odometry, moved(message, self._edge))
