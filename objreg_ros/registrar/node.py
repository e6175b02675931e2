# SPDX-License-Identifier: Apache-2.0
"""The door of the registrar: objects, views, gravity and odometry in; constraints, refusals and landmarks out."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from typing import Any, NamedTuple

from geometry_msgs.msg import Vector3Stamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import CameraInfo, PointCloud2
from std_msgs.msg import String
from std_srvs.srv import SetBool, Trigger

from objreg_ros.bridge import from_msg, qos
from objreg_ros.bridge.announcements import Announcements
from objreg_ros.bridge.door import DroppedError
from objreg_ros.bridge.indoors import Indoors
from objreg_ros.bridge.lifetime import await_kernels
from objreg_ros.bridge.markers import Scene
from objreg_ros.bridge.matching import MatchingDoor
from objreg_ros.bridge.params import ManagedParams, RelocalisedParams
from objreg_ros.bridge.relocalised import Whereabouts
from objreg_ros.bridge.spin import run
from objreg_ros.bridge.sync import Match, Need, Stream
from objreg_ros.bridge.transforms import hear_mount
from objreg_ros.bridge.worker import Backlog, Limit
from objreg_ros.data import Array, Frame
from objreg_ros.registrar.outcome import Outcome
from objreg_ros.registrar.registrar import FrameWindow, Registrar
from objreg_ros.registrar.warm import warm
from objreg_ros.registration.params import RegistrarNodeParams, RegistrarParams

PATIENCE_S = 1.0  # a newer keyframe waits before the search in hand is cut short, if some were overtaken of late
WAITING_KEYFRAMES = 8  # most that wait for a search; no frame is followed while so many do
GIVING_WAY = 10  # niceness of the search: the next image must not wait for it


class Job(NamedTuple):
    """A keyframe that waits for its search, and since when, by `time.monotonic`."""

    stamp_ns: int
    window: FrameWindow
    since: float


class RegistrarNode(MatchingDoor):
    """Follows every frame; searches, in a second worker, for the places that a keyframe shows again.

    A frame that completes a keyframe is in the books until its search is over. A keyframe that a newer one overtakes is
    stored without a search: nothing that was seen is lost. A search that newer ones wait for is cut short, and no frame
    is followed while too many wait.
    """

    def __init__(self, indoors: Indoors | None = None) -> None:
        kinds = RegistrarParams, RegistrarNodeParams, RelocalisedParams, ManagedParams
        super().__init__("registrar", *kinds, indoors=indoors)

    def open(self) -> None:
        """Load the kernels, open the store, publish and listen."""
        inputs = self.settings.of(RegistrarNodeParams)
        self._mount, self._seconds = hear_mount(self, inputs.mounting), inputs.limit
        await_kernels(lambda: warm(self.settings.of(RegistrarParams)), self.get_logger().info)
        self._registrar = Registrar(self.settings.of(RegistrarParams))
        with ExitStack() as refused:  # a store that stays open could not be opened again
            refused.callback(self._registrar.close)
            self._open_to(inputs, refused)
            refused.pop_all()

    def _open_to(self, inputs: RegistrarNodeParams, refused: ExitStack) -> None:
        self._tracking, self._telling = threading.Lock(), threading.Lock()
        self._enabled = True
        self._counts = dict(self._registrar.counts())
        self._unsearched, self._without_odometry = 0, 0
        self._camera: str | None = None  # the frame_id of the last frame
        self._names, self._scene, self._odom_frame = dict[int, str](), Scene(), "odom"
        limit = Limit(WAITING_KEYFRAMES, inputs.waiting_megabytes * 1_000_000, PATIENCE_S)
        self.searcher: Backlog[Job] = Backlog(
            self._search, self._keep, self.fail, limit, lambda job: job.window.nbytes, self._niceness()
        )
        refused.callback(self.searcher.close)
        self._announcements = Announcements(self)
        self._whereabouts = Whereabouts(self, lambda: (self._registrar.relocalised, self._registrar.whereabouts))
        self.create_service(Trigger, "~/reset", self._reset, callback_group=self.apart)
        self.create_service(Trigger, "~/save", self._save, callback_group=self.apart)
        self.create_service(SetBool, "~/enable", self._enable)
        self._listen(round(inputs.odom_slop * 1e9))

    def adopt(self) -> None:
        """Live parameters hold from the next frame and the next search on."""
        self._registrar.adopt(self.settings.of(RegistrarParams))
        self._seconds = self.settings.of(RegistrarNodeParams).limit

    def _niceness(self) -> int:
        """None where other rooms share Python's lock: a nice thread that holds it and has no processor holds up all."""
        return 0 if self.indoors.offers(self.resolve_topic_name("objects")) else GIVING_WAY

    def _listen(self, odom_slop_ns: int) -> None:
        room: dict[str, type] = {"objects": PointCloud2}
        if not self.indoors.offers(self.resolve_topic_name("objects")):  # else the word holds these too
            room |= {"view": PointCloud2, "view/camera_info": CameraInfo, "gravity": Vector3Stamped}
        self.listen(String, "labels", self._hear_labels, qos.latched())
        self.listen(Odometry, "odom", self._hear_odom, self.sensor(qos.ODOMETRY))
        for topic, kind in room.items():
            self.listen(kind, topic, self._hear(topic), qos.room(), watched=topic)
        self.expect("objects", "objects")
        exact = [Stream(topic) for topic in room]
        odom = Stream("odom", Need.OPTIONAL, odom_slop_ns, depth=1000, enclosing=True)
        self.begin([*exact, Stream("labels", Need.LATCHED), odom])

    # Hear

    def _hear_labels(self, message: Any) -> None:
        names = self.read_aside("labels", from_msg.labels, message)
        if names is not None:
            self._names = names
            self.feed("labels", 0, names)

    def _hear_odom(self, message: Any) -> None:
        odometry = self.read_aside("odom", from_msg.odometry, message)
        if odometry is not None:
            self.feed("odom", odometry.stamp_ns, odometry)

    def _hear(self, topic: str) -> Callable[[Any], None]:
        return lambda message: self.feed(topic, from_msg.stamp_ns(message), message)

    # Compute

    def compute(self, stamp_ns: int, payload: Match) -> bool:
        """Follow one frame; a keyframe goes on to the searcher."""
        if not self._enabled:
            raise DroppedError("disabled", "")
        frame, T_body_camera = self._frame(payload)
        self._watch_camera(frame.frame_id)
        self._scene.see(frame)
        with self._tracking:  # until it waits: none that a service ends comes before it
            with self.ledger.timed("track"):
                window = self._registrar.track(frame)
            if window is not None:
                self.searcher.put(Job(stamp_ns, window, time.monotonic()))
        self._whereabouts.mounted(T_body_camera)
        self._whereabouts.look()
        return window is None

    def _frame(self, match: Match) -> tuple[Frame, Array | None]:
        """With where the camera sits on the body of its odometry."""
        odom, camera = match["odom"], from_msg.frame_id(match["objects"])
        self._without_odometry += odom is None
        self._odom_frame = odom[0].frame_id if odom else self._odom_frame
        T_body_camera = self._mount.T_body_camera(odom, camera)
        if isinstance(match["objects"], Frame):
            return self.read("frame", from_msg.followed, match["objects"], odom, T_body_camera), T_body_camera
        topics = ("objects", "view", "view/camera_info", "gravity", "labels", "odom")
        return self.read("frame", from_msg.frame, *(match[topic] for topic in topics), T_body_camera), T_body_camera

    def _watch_camera(self, frame_id: str) -> None:
        """Say so where the frames of two cameras come in turn."""
        if self._camera not in (None, frame_id):
            self.throttled.remind(
                "camera",
                f"expected frames of one camera, got one of {frame_id!r} after one of {self._camera!r}: every change "
                "begins another session; give each camera a registrar of its own",
            )
        self._camera = frame_id

    def _search(self, job: Job) -> None:
        self.ledger.spend("wait", time.monotonic() - job.since)
        self.conclude(job.stamp_ns, lambda: self._find(job.window, "search", self._seconds))

    def _keep(self, job: Job) -> None:
        """Store a keyframe without a search: a newer one waits."""
        self._unsearched += 1
        self.throttled.warn("unsearched", "a keyframe was stored without a search: a newer one came before its turn")
        self.conclude(job.stamp_ns, lambda: self._find(job.window, "keep", 0.0))

    def _find(self, window: FrameWindow, stage: str, seconds: float) -> bool:
        with self.ledger.timed(stage):
            outcome = self._registrar.search(window, seconds, self.searcher.hurried)
        self._publish(outcome)
        return True

    def _publish(self, outcome: Outcome) -> None:
        with self._telling:  # the searcher's thread and that of ~/save
            self._tell(outcome)

    def _tell(self, outcome: Outcome) -> None:
        self._announcements.closures(outcome.closures)
        self._announcements.refusals(outcome.rejected)
        self._count()
        self._whereabouts.look()
        if outcome.keyframe_ns is not None:
            seen = outcome.observations, outcome.keyframe_ns, outcome.frame_id
            self._announcements.landmarks(*seen, self._names, outcome.session)
            self._scene.settle(outcome.keyframe_ns, outcome.closures, outcome.rejected)
            objects = [(known.landmark, known.label, known.position) for known in self._registrar.landmarks_here]
            self._announcements.markers(self._scene.markers(objects, outcome.keyframe_ns, self._odom_frame))

    def _count(self) -> None:
        """Count what is stored, and say so where the oldest had to go."""
        forgotten, self._counts = self._counts["forgotten"], dict(self._registrar.counts())
        if self._counts["forgotten"] != forgotten:
            self.throttled.warn(
                "forgotten",
                f"the store is full: it keeps {self._counts['keyframes']} keyframes (max_keyframes), and has forgotten "
                f"the oldest {self._counts['forgotten']}; places that only they show are not recognised any more",
            )

    def extra_diagnostics(self) -> Mapping[str, object]:
        """What is stored and what waits, and what was told of closures."""
        stored = {f"stored {what}": count for what, count in self._counts.items() if what != "forgotten"}
        counts = {
            "stored unsearched": self._unsearched,
            "forgotten keyframes": self._counts["forgotten"],
            "waiting keyframes": len(self.searcher),
            "waiting poses": self._registrar.waiting,
            "frames without odometry": self._without_odometry,
        }
        return {**super().extra_diagnostics(), **stored, **counts, **self._announcements.told()}

    # Services

    async def _reset(self, _: Any, response: Any) -> Any:
        """Once the search in hand is over; the keyframes that wait for theirs are dropped."""
        response.success, response.message = await self.aside(self._forget)
        return response

    def _forget(self) -> tuple[bool, str]:
        """Whether everything is forgotten; if the store does not let it, why, and nothing is."""
        with self._tracking:
            waiting = self.searcher.rest()
            try:
                self._registrar.reset()
                self._counts = dict(self._registrar.counts())
            except OSError as error:
                self.searcher.give_back(waiting)
                return False, str(error)
        for job in waiting:
            self.drop(job.stamp_ns, "reset")
        with self._telling:
            self._scene.clear()
        self._whereabouts.look()
        return True, "forgot every keyframe"

    async def _save(self, _: Any, response: Any) -> Any:
        """Also ends the keyframe in hand and settles what waits: what can be published is, before the answer.

        With odometry the session goes on; without, our own tracking begins another.
        """
        response.success, response.message = await self.aside(self._settle_and_save)
        return response

    def _settle_and_save(self) -> tuple[bool, str]:
        """Whether it could be, and where it is or what was in the way. The last keyframe comes after all others."""
        try:
            with self._tracking:
                self.searcher.drain()
                self._publish(self._registrar.finish(self._seconds, self.searcher.hurried))
            return True, self._registrar.save()
        except (ValueError, OSError) as error:
            return False, str(error)

    def _enable(self, request: Any, response: Any) -> Any:
        self._enabled = request.data
        response.success, response.message = True, "enabled" if request.data else "frames are dropped as disabled"
        return response

    def shut(self) -> None:
        """End both workers, the search in hand early, store what they had not come to, let go of the store."""
        self.searcher.shut()
        self.end_aside()
        self.end_work()
        self.searcher.close()
        with ExitStack() as ends:
            ends.callback(self._registrar.close)
            self._store_the_rest()

    def _store_the_rest(self) -> None:
        """Store the keyframes that were not searched for; of those that cannot be the log says how many and why."""
        lost = list[str]()
        for window in (*(job.window for job in self.searcher.rest()), *self._registrar.end()):
            if window is not None:
                try:
                    self._registrar.search(window, 0.0)
                except (ValueError, OSError) as error:
                    lost.append(str(error))
        if lost:
            self.get_logger().error(f"the last keyframes could not be stored, {len(lost)} are lost: {lost[-1]}")


def main() -> int:
    """The executable ``registrar``."""
    return run(RegistrarNode)


if __name__ == "__main__":
    sys.exit(main())
