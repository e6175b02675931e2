# SPDX-License-Identifier: Apache-2.0
"""The keyframes that were made ready last, as long as they take no more than so many bytes."""

from __future__ import annotations

import threading
from collections import OrderedDict
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from objreg_ros.registration.keyframe import Keyframe
from objreg_ros.registration.params import RegistrationParams
from objreg_ros.registration.prepare.prepared import AtNeed, Prepared, prepare

MOST_BYTES = 64_000_000
"""Of 3 to 6 MB a keyframe. A search needs five of them, and mostly those of the one before: with twelve a keyframe in
two is made ready once more (50 ms) that would be kept among sixty."""


class PreparedCache:
    """Keyframes made ready, the last that were asked for; the newest is kept whatever it takes. For several threads."""

    def __init__(self, params: RegistrationParams, most_bytes: int = MOST_BYTES) -> None:
        self._params, self.most_bytes = params, most_bytes
        self._lock = threading.Lock()
        self._entries: OrderedDict[int, Prepared] = OrderedDict()

    def __len__(self) -> int:
        return len(self._entries)

    @property
    def nbytes(self) -> int:
        """The memory of all that is kept, with what was made of it since."""
        with self._lock:
            return sum(map(held_bytes, self._entries.values()))

    def get(self, keyframe: Keyframe) -> Prepared:
        """The keyframe made ready, now or before; the entry holds it, so its id stays its own."""
        with self._lock:
            prepared = self._entries.get(id(keyframe))
            if prepared is not None:
                self._entries.move_to_end(id(keyframe))
                return prepared
        prepared = prepare(keyframe, self._params)
        with self._lock:
            self._entries[id(keyframe)] = prepared
            self._entries.move_to_end(id(keyframe))
            self._make_space()
        return prepared

    def _make_space(self) -> None:
        """Let those go that were not asked for longest; all are weighed anew, since they grow while they are used."""
        sizes = [held_bytes(prepared) for prepared in self._entries.values()]
        total = sum(sizes)
        for size in sizes[:-1]:
            if total <= self.most_bytes:
                return
            self._entries.popitem(last=False)
            total -= size


def held_bytes(value: Any) -> int:
    """The memory of all arrays in a value: of its fields, its items, and what it has made until now."""
    if isinstance(value, np.ndarray):
        return value.nbytes
    if isinstance(value, AtNeed):
        return sum(map(held_bytes, value.made))
    if isinstance(value, tuple | list):
        return sum(map(held_bytes, value))
    if hasattr(value, "__dict__"):
        return sum(map(held_bytes, list(vars(value).values())))
    if is_dataclass(value):
        return sum(held_bytes(getattr(value, one.name)) for one in fields(value))
    return 0
