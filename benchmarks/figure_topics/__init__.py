# SPDX-License-Identifier: Apache-2.0
"""The topics of docs/figures.md, in its order."""

from __future__ import annotations

from figure_topics import founding, live, loops, maps, pairs, parts, robots
from figure_topics.topic import Topic

TOPICS: tuple[Topic, ...] = (
    *pairs.TOPICS,
    *founding.TOPICS,
    *loops.TOPICS,
    *maps.TOPICS,
    *robots.TOPICS,
    *live.TOPICS,
    *parts.TOPICS,
)

README = {
    "pairs_rpy.accepted": "pairs of frames of RPY, half of which could close",
    "pairs_rpy.peers": "the usual methods on the same pairs",
    "loops_real.closed": "real loops, drifting odometry",
    "relocalisation.found": "sessions that begin anywhere in a place that is stored and know where they are in 5 s",
    "robots.constraints": "constraints of three simulated robots and one registrar",
    "robots.met": "the same: stretches where two met that are tied; error of the one map",
    "latency.usage": "live at 30 Hz, four objects, all nodes in one process",
    "latency.constraint": "from an image to the constraints about it, once the camera is proven",
    "start.one": "all nodes in one process until they listen",
}  # the rows that README shows, by their claims there
