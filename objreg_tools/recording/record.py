# SPDX-License-Identifier: Apache-2.0
"""The interface of every recording: topics, and records in order of time that are decoded only on request."""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any, Self

from rosbags.interfaces import Qos, QosDurability
from rosbags.typesys.store import Typestore

from objreg_tools.recording.rosbag.messages import obstacle, serialise, standard_types

VALID_NAME = re.compile(r"/?[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*")  # in ROS 2: no part begins with a digit
LONGEST_NAME = 247


@dataclass(frozen=True, slots=True)
class Topic:
    """A topic of a recording; ``msgtype`` as in ``sensor_msgs/msg/Image``."""

    name: str
    msgtype: str
    count: int


@dataclass(frozen=True, slots=True)
class Record:
    """One recorded message. ``stamp_ns`` is when it was recorded; the time of the measurement is in its header."""

    topic: str
    msgtype: str
    stamp_ns: int
    decode: Callable[[], Any]
    encode: Callable[[], bytes]

    @classmethod
    def of(cls, topic: str, message: Any, stamp_ns: int) -> Record:
        """A record of a message made with `objreg_tools.recording.rosbag.messages`."""
        return cls.made(topic, message.__msgtype__, stamp_ns, lambda: message)

    @classmethod
    def made(cls, topic: str, msgtype: str, stamp_ns: int, make: Callable[[], Any]) -> Record:
        """A record whose message is made when it is wanted."""
        return cls(topic, msgtype, stamp_ns, make, lambda: serialise(make()))

    @property
    def message(self) -> Any:
        """The message, decoded now; keep it if it is needed twice. Its fields are those of the ROS message.

        ValueError for bytes or a picture that does not decode; what comes after it may still do.
        """
        return self.decode()

    def read(self) -> Any | None:
        """The message; None where it does not decode."""
        try:
            return self.decode()
        except ValueError:
            return None

    @property
    def cdr(self) -> bytes:
        """The message as ROS 2 sends it; ValueError if it is of a ROS 1 type that ROS 2 does not have."""
        return self.encode()


def misnamed(topic: str) -> str:
    """Why ROS 2 cannot have a topic of this name, as text; empty if it can."""
    fits = VALID_NAME.fullmatch(topic) is not None and len(topic) <= LONGEST_NAME
    return "" if fits else "no valid name in ROS 2"


class Recording(ABC):
    """A recording that is open; a context manager. ``notes`` say what was assumed or is odd, for the user.

    ``of_pictures`` is whether it is a folder of pictures: its topics are made here, and no remap finds others.
    ``made_of`` says of such topics which files they are made of, and what was assumed of these.
    """

    of_pictures: bool = False
    made_of: Mapping[str, str] = MappingProxyType({})
    path: Path
    kind: str
    topics: dict[str, Topic]
    start_ns: int
    end_ns: int
    notes: list[str]

    @abstractmethod
    def records(
        self, topics: Collection[str] | None = None, start_ns: int | None = None, end_ns: int | None = None
    ) -> Iterator[Record]:
        """The records of some topics (None: of all) from ``start_ns`` and before ``end_ns``, in order of time."""

    def obstacles(self, shipped_only: bool = True) -> dict[str, str]:
        """The topics whose records ROS 2 cannot have (`Record.cdr` refuses them, or its bytes are read wrongly).

        Each with the reason. Without ``shipped_only``, a type that ROS 2 does not ship is none by itself where ROS 2
        has recorded it: its bytes can be passed on.
        """
        reasons = {
            topic.name: misnamed(topic.name) or self._obstacle(topic.msgtype, shipped_only)
            for topic in self.topics.values()
        }
        return {name: reason for name, reason in reasons.items() if reason}

    def offered_qos(self) -> dict[str, list[Qos]]:
        """The QoS of the publishers of each topic; without the topics of which nothing is known."""
        return {}

    @property
    def latched(self) -> dict[str, int]:
        """The topics whose last messages a late subscriber still got, like /tf_static, and of how many at least.

        That is one a publisher where nobody recorded the depth.
        """
        kept = QosDurability.TRANSIENT_LOCAL
        depths = {
            topic: sum(max(1, offer.depth) for offer in profiles if offer.durability is kept)
            for topic, profiles in self.offered_qos().items()
        }
        return {topic: depth for topic, depth in depths.items() if depth}

    def _obstacle(self, msgtype: str, shipped_only: bool) -> str:
        """Why ROS 2 cannot have what is of a type, as text; empty if it can."""
        return obstacle(msgtype, self._types())

    def _types(self) -> Typestore:
        """The message types as the recording knows them."""
        return standard_types()

    def close(self) -> None:  # noqa: B027  a folder has nothing to close
        """Let go of the files."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def seconds(self) -> float:
        """From the first to the last record."""
        return max(0.0, (self.end_ns - self.start_ns) * 1e-9)
