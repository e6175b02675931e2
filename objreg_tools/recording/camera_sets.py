# SPDX-License-Identifier: Apache-2.0
"""The pictures of one camera, chosen whole: colour, with depth or a cloud of the same camera and its camera_info."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from objreg_tools.recording.camera_names import FRONT, HALF, SIDE, camera_words, relation, share_frame
from objreg_tools.recording.record import Topic
from objreg_tools.recording.topic_rules import (
    CAMERA_INFO,
    COMPRESSED,
    HALF_OF_STEREO,
    NATIVE,
    NATIVE_DEPTH,
    OWN,
    REGISTERED,
    RULES,
    STEREO,
    candidates,
    fits,
    may_be,
    rank,
)

SIZES = re.compile(r"/(hd|qhd|sd)/")  # kinect2_bridge has each picture in three
BY_DEPTH, BY_CLOUD, BY_TWO_CAMERAS, BY_ONE_CAMERA = range(4)  # how depth comes to colour, best first


@dataclass(frozen=True, slots=True)
class CameraSet:
    """The topics of one camera; None for what it has not. ``order``: less is better."""

    image: str | None
    depth: str | None
    points: str | None
    camera_info: str | None
    colour_info: str | None
    order: tuple[Any, ...] = ()

    @property
    def complete(self) -> bool:
        """Whether the graph can run on it."""
        return self.image is not None and (self.points is not None or None not in (self.depth, self.camera_info))


class CameraSets:
    """The sets that the topics of a recording make. ``asked``: input -> topic, "" for none; ``free``: not asked for."""

    def __init__(
        self,
        topics: Mapping[str, Topic],
        free: Iterable[Topic],
        asked: Mapping[str, str],
        frames: Mapping[str, str] | None = None,
    ) -> None:
        self._asked, self._frames, free = asked, frames, list(free)
        self._infos = [
            t.name for t in topics.values() if t.msgtype == CAMERA_INFO and t.count and not OWN.search(t.name)
        ]
        self._images = self._of("image", free)
        self._clouds = self._of("points", free)
        rivals = {*self._clouds, *(name for name in self._images if name in asked.values())}
        self._depths = [name for name in self._of("depth", free) if name not in rivals]
        if asked.get("depth") and not asked.get("points"):
            self._clouds = []
        elif asked.get("points") and not asked.get("depth"):
            self._depths = []
        self._pictures = [*self._images, *self._depths]

    def ranked(self) -> list[CameraSet]:
        """All sets, best first; at least one, be it empty."""
        found = sorted(self._pairs(), key=lambda camera: camera.order)
        return found or [self._half()]

    def _of(self, name: str, free: list[Topic]) -> list[str]:
        if name in self._asked:
            return [self._asked[name]] if self._asked[name] else []
        return candidates(RULES[name], free)

    def _pairs(self) -> Iterator[CameraSet]:
        for image in self._images:
            for depth in self._depths:
                sure = self._sure(image, depth, "depth")
                if image != depth and sure is not None:
                    yield self._with_depth(image, depth, sure)
            for points in self._clouds:
                sure = self._sure(image, points, "points")
                if sure is not None:
                    yield self._with_cloud(image, points, sure)

    def _sure(self, image: str, view: str, kind: str) -> int | None:
        """How sure colour and a view are of one camera; what is asked for outright needs no proof."""
        is_asked = bool(self._asked.get("image"))
        if is_asked and self._asked.get(kind):
            return 0
        if NATIVE in image and kind == "depth" and not may_be(NATIVE_DEPTH, view):
            return None
        sure = relation(image, view, self._frames)
        return None if not is_asked and sure is not None and self._is_lone_half(image, view, sure) else sure

    def _is_lone_half(self, image: str, view: str, sure: int) -> bool:
        """Whether colour is of one lens of two, and nothing says that depth is of this lens."""
        if not fits(HALF_OF_STEREO, image):
            return False
        if share_frame(image, view, self._frames):
            return False
        is_left = sure == HALF and "left" in camera_words(image) and not self._is_elsewhere(image, view)
        return not is_left and (sure >= HALF or not {"left", "right"} & set(camera_words(view)))

    def _is_elsewhere(self, image: str, view: str) -> bool:
        """Whether depth that names no lens is of another than the left, whose it is by the convention of stereo.

        OAK-D's is of its colour camera or of the right lens. Depth of another frame needs a camera_info of its own.
        """
        is_apart = share_frame(image, view, self._frames) is False
        is_known = view in self._depths and any(_folder(info) == _folder(view) for info in self._infos)
        return fits(STEREO, view) or (is_apart and not is_known)

    def _with_depth(self, image: str, depth: str, sure: int) -> CameraSet:
        registered = NATIVE in image or rank(RULES["depth"], depth) < REGISTERED
        registered = registered or share_frame(image, depth, self._frames) is True
        info = self._asked_or("camera_info", self._info_of(depth, image, registered))
        registered = registered or self._has_one_info(image, depth, info)
        own = self._info_of(image)
        colour_info = self._asked_or("colour_info", None if own == info else own)
        kind = BY_DEPTH if registered else BY_TWO_CAMERAS if info and colour_info else BY_ONE_CAMERA
        order = self._order(image, depth, "depth", sure, kind, info is not None)
        return CameraSet(image, depth, None, info, colour_info, order)

    def _with_cloud(self, image: str, points: str, sure: int) -> CameraSet:
        info = self._asked_or("camera_info", self._info_of(image, points))
        order = self._order(image, points, "points", sure, BY_CLOUD, True)
        return CameraSet(image, None, points, info, self._asked_or("colour_info", None), order)

    def _order(self, image: str, view: str, kind: str, sure: int, how: int, complete: bool) -> tuple[Any, ...]:
        where = _place(camera_words(image))
        is_of_other_size = SIZES.findall(image) != SIZES.findall(view)
        apart = share_frame(image, view, self._frames) is False
        names = rank(RULES["image"], image), rank(RULES[kind], view), len(image), len(view), image, view
        return (not complete, sure, how, where, is_of_other_size, apart, *names)

    def _half(self) -> CameraSet:
        """Colour alone, or what there is without colour."""
        image = next(
            (name for name in self._images if name in self._asked.values() or not fits(HALF_OF_STEREO, name)), None
        )
        depth = points = None
        if image is None or self._asked.get("depth") or self._asked.get("points"):
            depth, points = next(iter(self._depths), None), next(iter(self._clouds), None)
        if depth and points and rank(RULES["depth"], depth) >= REGISTERED:
            depth = None
        points = None if depth else points
        of = next(filter(None, (depth, image, points)), None)
        info = self._info_of(of) if of else self._infos[0] if len(self._infos) == 1 else None
        return CameraSet(image, depth, points, self._asked_or("camera_info", info), self._asked_or("colour_info", None))

    def _asked_or(self, name: str, found: str | None) -> str | None:
        return self._asked.get(name, found) or None

    def _info_of(self, picture: str, other: str | None = None, registered: bool = False) -> str | None:
        """The camera_info beside a picture, else beside the other of its camera, else the only one that is free.

        Depth that is ``registered`` to colour and has none in its own folder takes that of colour's.
        """
        fitting = [i for i in self._infos if relation(i, picture, self._frames) is not None]
        places = [picture, other] if other else [picture]
        own = [info for info in fitting if _folder(info) == _folder(picture)]
        if not own and registered and other:
            common = _shared(other, picture)
            own = [
                info for info in fitting if _folder(info) == _folder(other) and common >= _most_shared(fitting, picture)
            ]
        if own:
            return own[0]
        for place in places:
            near = min(((-_shared(i, place), len(i), i) for i in fitting), default=None)
            if near is not None and -near[0] >= _folders(place):
                return near[2]
        is_free = len(self._infos) == 1 and (fitting or not self._has_pictures(self._infos[0]))
        return self._infos[0] if is_free else None

    def _has_one_info(self, image: str, depth: str, info: str | None) -> bool:
        """Whether colour, depth and one camera_info lie in one folder, as of a camera that makes both: Isaac Sim's."""
        is_apart = share_frame(image, depth, self._frames) is False
        return info is not None and not is_apart and _folder(image) == _folder(depth) == _folder(info)

    def _has_pictures(self, info: str) -> bool:
        return any(_folder(info) == _folder(picture) for picture in self._pictures)


def _place(words: Iterable[str]) -> int:
    """0 for a camera that looks ahead, 2 for one that rather does not, by its name."""
    return 0 if any(FRONT.match(part) for part in words) else 2 if SIDE.intersection(words) else 1


def _most_shared(infos: Iterable[str], picture: str) -> int:
    return max((_shared(info, picture) for info in infos), default=0)


def _folder(topic: str) -> str:
    return COMPRESSED.sub("", topic).strip("/").rpartition("/")[0]


def _folders(picture: str) -> int:
    """How many leading folders a camera_info must share with a picture to be of the same camera, two at most."""
    return min(2, len(COMPRESSED.sub("", picture).strip("/").split("/")) - 1)


def _shared(info: str, picture: str) -> int:
    pairs = zip(info.strip("/").split("/")[:-1], picture.strip("/").split("/"), strict=False)
    return next((i for i, (a, b) in enumerate(pairs) if a != b), len(info.strip("/").split("/")) - 1)
