# SPDX-License-Identifier: Apache-2.0
"""The pictures of all pairs of a run, as many as a page can carry."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from objreg_ros.data.images import DepthImage
from objreg_ros.registration.prepare.keypoints import Keypoints
from objreg_tools.report.closures.matched_features import FeatureLines, feature_lines, keypoints_in
from objreg_tools.report.closures.matched_objects import Drawn, pair_drawing
from objreg_tools.report.packed import zipped
from objreg_tools.report.run.pairs import PairRow, by_interest
from objreg_tools.report.run.pictures import Album, data_uri, overlay

PAGE_BYTES = 7_000_000  # of all thumbnails of a page; that of one run has 15 MB for everything
LINE_BYTES = 16  # of a line between two features
QUALITY = 75  # of a WebP: two thirds of the bytes of what the galleries show


@dataclass
class Thumbnails:
    """Data URIs: ``moments`` by stamp and ``overlays`` by the key of a pair; its objects in ``drawings``, what its pose
    brings together of its features in ``features``.

    ``lacking`` counts the pairs without pictures by why; ``left_out`` is how many had no place.
    """

    moments: dict[int, str] = field(default_factory=dict)
    overlays: dict[str, str] = field(default_factory=dict)
    drawings: dict[str, Drawn] = field(default_factory=dict)
    features: dict[str, FeatureLines] = field(default_factory=dict)
    lacking: Counter[str] = field(default_factory=Counter)
    left_out: int = 0
    size: int = 0
    _keypoints: dict[int, Keypoints] = field(default_factory=dict)

    def add_pictures(self, pair: PairRow, album: Album, most_bytes: int) -> None:
        """Both pictures of a pair, and the second over the first by its pose; nothing where they have no place."""
        first, second = album.at(pair.outcome.from_ns), album.at(pair.outcome.to_ns)
        if first is None or second is None:
            self.lacking[album.lacking(pair.outcome.from_ns) or album.lacking(pair.outcome.to_ns)] += 1
            return
        moments = self._new_moments({pair.outcome.from_ns: first, pair.outcome.to_ns: second})
        T_from_to = pair.outcome.T_from_to
        over = "" if T_from_to is None else data_uri(overlay(first, second, T_from_to), QUALITY)
        drawn = pair_drawing(pair, first, second)
        size = sum(map(len, moments.values())) + len(over) + len(zipped(drawn.marks.encode()))
        if self.size + size > most_bytes:
            self.left_out += 1
            return
        self.size += size
        self.moments |= moments
        self.drawings[pair.key] = drawn
        if over:
            self.overlays[pair.key] = over
            self.features[pair.key] = self._features(pair, first, second)
            self.size += LINE_BYTES * len(self.features[pair.key].ends)

    def _features(self, pair: PairRow, first: DepthImage, second: DepthImage) -> FeatureLines:
        """The features that the pose of a pair brings together."""
        assert pair.outcome.T_from_to is not None
        ends = self._keypoints_at(pair.outcome.from_ns, first), self._keypoints_at(pair.outcome.to_ns, second)
        return feature_lines(*ends, (first.intrinsics, second.intrinsics), pair.outcome.T_from_to)

    def _keypoints_at(self, stamp_ns: int, image: DepthImage) -> Keypoints:
        """The keypoints of a picture, found once."""
        if stamp_ns not in self._keypoints:
            self._keypoints[stamp_ns] = keypoints_in(image)
        return self._keypoints[stamp_ns]

    def _new_moments(self, seen: Mapping[int, DepthImage]) -> dict[int, str]:
        """The pictures that are not there yet."""
        return {
            stamp_ns: data_uri(image.rgb, QUALITY)
            for stamp_ns, image in seen.items()
            if stamp_ns not in self.moments and image.rgb is not None
        }


def thumbnails(pairs: Iterable[PairRow], album: Album | None, most_bytes: int = PAGE_BYTES) -> Thumbnails:
    """The pictures of pairs, the most interesting first; of what was tried, or has two stamps at least."""
    drawn = Thumbnails()
    if album is None:
        return drawn
    for pair in by_interest(pairs):
        if pair.outcome.from_ns == pair.outcome.to_ns:
            continue
        if drawn.left_out:
            drawn.left_out += 1
        else:
            drawn.add_pictures(pair, album, most_bytes)
    return drawn
