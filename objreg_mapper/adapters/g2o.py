# SPDX-License-Identifier: Apache-2.0
"""``objreg_to_g2o``: a file of odometry and constraints, whole at any time, for whoever reads g2o's text."""

from __future__ import annotations

import sys
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

from rclpy.clock import Clock, ClockType
from std_srvs.srv import Trigger

from objreg_mapper.adapters.adapter import Adapter
from objreg_mapper.adapters.body import Body
from objreg_mapper.adapters.diagnostics import G2oDiagnostics
from objreg_mapper.adapters.odometry_in import OdometryIn
from objreg_mapper.adapters.params import BodyParams, ToG2oParams
from objreg_mapper.closure_constraint import ImplausibleError
from objreg_mapper.formats.g2o import graph_text, times_text
from objreg_mapper.map_files import graph_file, write_graph
from objreg_mapper.params import MapperParams
from objreg_mapper.pose_graph import PoseGraph
from objreg_mapper.restart import Anew
from objreg_ros.bridge.node.node_base import DroppedError
from objreg_ros.bridge.node.spin import run
from objreg_ros.data.closures import LoopClosure, Moments
from objreg_ros.data.frames import Odometry
from objreg_ros.diagnostics import Diagnostics


class ToG2o(Adapter):
    """Keeps a pose graph that nobody solves, and writes it every period and at the end."""

    def __init__(self) -> None:
        super().__init__("objreg_to_g2o", ToG2oParams, BodyParams)
        self._params_g2o = self.settings.of(ToG2oParams)
        self._path = graph_file(self._params_g2o.graph_path)
        self._writer = ThreadPoolExecutor(max_workers=1, thread_name_prefix="writer")  # in turn, beside the executor
        self._writing = self._writer.submit(lambda: None)
        self._maps = 0
        self._graph, self._has_news = self._empty(), False
        self._body = Body(self)
        self._odom = OdometryIn(self, self._follow, self._begin_anew)
        self.create_service(Trigger, "~/save", self._save, callback_group=self.apart)
        self.create_timer(self._params_g2o.period, self._write_news, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self.expect("odom", "odom")
        self.listen_for_closures()

    def _empty(self) -> PoseGraph:
        of = self._params_g2o
        return PoseGraph(
            MapperParams(keyframe_translation=of.keyframe_translation, keyframe_rotation=of.keyframe_rotation)
        )

    @property
    def path(self) -> Path:
        """The file of the map that is made now."""
        return self._path.with_stem(f"{self._path.stem}_{self._maps}") if self._maps else self._path

    def _follow(self, odometry: Odometry) -> None:
        self._has_news = self._graph.add_odometry(odometry) or self._has_news

    def _begin_anew(self, anew: Anew) -> None:
        """Nothing ties what comes to what was: the old map's file stays, and what waits for it goes."""
        if self._has_news:
            self._write()
        self._maps += 1
        self._graph = self._empty()
        for key in list(self.waiting):
            self.drop_constraint(key, anew.value)

    def hand_over(self, closure: LoopClosure) -> bool:
        """An edge between the two nearest vertices, once odometry covers both keyframes."""
        T_body_camera = self._body.of(closure, self._odom.newest)
        if self._odom.newest is None or T_body_camera is None:
            return False
        try:
            tied = self._graph.add_closure(closure, T_body_camera)
        except ImplausibleError as error:
            raise DroppedError("implausible", str(error)) from error
        except ValueError as error:
            raise DroppedError("two_clocks", str(error)) from error
        if not tied and self._graph.in_gap(closure):
            raise DroppedError("odometry_gap", "no odometry came around a keyframe of the constraint")
        if not tied and closure.from_ns < self._graph.odometry.stamps_ns[0]:
            raise DroppedError("before_odometry", "odometry begins after the first keyframe of the constraint")
        self._has_news = tied or self._has_news
        return tied

    def take_back(self, key: Moments) -> bool:
        """Leave the edge out of the file from now on."""
        self._graph.withdraw(lambda closure: closure.moments == key)  # it may come again, as another tie
        self._has_news = True
        return True

    # The file

    def _write_news(self) -> None:
        if self._has_news and self._writing.done():
            self._write()

    def _write(self) -> Future[None]:
        """Begin to write the graph as it is now, whole or not at all; OSError in what comes back if it cannot be."""
        self._has_news = False
        self._writing = self._writer.submit(
            write_graph, self.path, graph_text(*self._graph.flat()), times_text(self._graph.flat_times())
        )
        self._writing.add_done_callback(self._look_at)
        return self._writing

    def _look_at(self, writing: Future[None]) -> None:
        error = writing.exception()
        if error is not None:
            self._has_news = True
            self.throttled.warn("unwritable", f"the graph is not written, and will be tried again: {error}")

    async def _save(self, _: Any, response: Any) -> Any:
        if not self._writing.done():
            response.success, response.message = False, "an earlier graph is not written yet; call again"
            return response
        path, writing = self.path, self._write()
        try:
            await self.aside(writing.result)
        except OSError as error:
            response.success, response.message = False, str(error)
        else:
            response.success, response.message = True, str(path)
        return response

    def own_diagnostics(self) -> tuple[Diagnostics, ...]:
        """And what the file has."""
        graph = self._graph
        own = G2oDiagnostics(vertices=len(graph.keyframes), constraints=len(graph.closure_ties))
        return (*super().own_diagnostics(), own)

    def close(self) -> None:
        """Write what is new, then end."""
        try:
            if self._has_news:
                self._write().result()
        finally:
            self._writer.shutdown()
            super().close()


def main() -> int:
    """The executable ``objreg_to_g2o``."""
    return run(ToG2o)


if __name__ == "__main__":
    sys.exit(main())
