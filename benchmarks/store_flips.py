# SPDX-License-Identifier: Apache-2.0
"""Flipped bits in copies of a store: what is read then is what was written, or one line says that it is not.

`flip_store` is for `attacks.py` and for the tests; it makes no figures of its own.
"""

from __future__ import annotations

import random
import shutil
from collections import Counter
from collections.abc import Callable, Iterable
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from objreg_ros.memory.store import Store, StoreError

LOG = "-wal"
Said = dict[str, Any]


def flip_store(path: Path, flips: int, folder: Path, seed: int = 0) -> tuple[Counter[str], list[str]]:
    """Flip one random bit of a copy of the store at ``path``, and of its log if it has one, so many times.

    The copies are made in ``folder``. Every other one is opened to be written. Returns how many were ``same`` (read as
    if nothing had been), ``refused`` (at the opening) and ``partly`` (some keyframes, objects or closures are refused,
    the others are the same), and what must not be, a line each: ``wrong`` (something else was read) and ``raised``
    (an error of another kind, or of several lines).
    """
    draw, counts, faults = random.Random(seed), Counter[str](), []
    parts = [part for part in (path, path.with_name(path.name + LOG)) if part.exists() and part.stat().st_size]
    whole = {part: part.read_bytes() for part in parts}
    copy = folder / path.name
    wanted = _read_copy(whole, copy, write=False)
    for k in range(flips):
        part = draw.choices(parts, [len(whole[p]) for p in parts])[0]
        if k % 4 == 3:  # structure is met more rarely than points
            part = path
        size = len(whole[part])
        bit = draw.randrange(8 * min(size, 8192) if k % 4 == 3 else 8 * size)
        damaged = bytearray(whole[part])
        damaged[bit // 8] ^= 1 << bit % 8
        where = f"bit {bit % 8} of byte {bit // 8} of {part.name}"
        try:
            outcome = _compare(wanted, _read_copy({**whole, part: bytes(damaged)}, copy, write=k % 2 == 1))
        except StoreError as error:
            outcome = "refused" if "\n" not in str(error) else "raised: several lines"
        except Exception as error:
            outcome = f"raised: {type(error).__name__}: {error}"
        counts[outcome.split(":")[0]] += 1
        if outcome.startswith(("wrong", "raised")):
            faults.append(f"{where}: {outcome}")
    return counts, faults


def _read_copy(parts: dict[Path, bytes], copy: Path, write: bool) -> Said:
    shutil.rmtree(copy.parent, ignore_errors=True)
    copy.parent.mkdir(parents=True)
    for part, content in parts.items():
        copy.with_name(part.name).write_bytes(content)
    with closing(Store(copy, read_only=not write)) as store:
        return read_all(store)


def read_all(store: Store) -> Said:
    """All that a store says, by name; None where it refuses to say it in one line."""
    said: Said = {name: _asked(getattr(store, name)) for name in ("next_keyframe", "next_landmark", "next_session")}
    said["counts"] = _asked(store.counts)
    said["ids"] = store.keyframe_ids()
    said["last"] = _asked(lambda: [sorted(store.sessions_beyond("", 9, k * 10**9)) for k in range(60)])
    said["sightings"] = _asked(lambda: _plain(store.sightings()))
    said["closures"] = _asked(lambda: _plain(store.closures()))
    for number in store.keyframe_ids():
        said[f"keyframe {number}"] = _asked(partial(_keyframe, store, number))
        said[f"objects {number}"] = _asked(partial(_objects, store, number))
    return said


def _keyframe(store: Store, number: int) -> Any:
    return _plain_one(store.keyframe(number))


def _objects(store: Store, number: int) -> Any:
    return _plain(store.sightings(number))


def _asked(ask: Callable[[], Any]) -> Any:
    try:
        return ask()
    except StoreError as error:
        if "\n" in str(error):
            raise ValueError(f"several lines: {error}") from error
        return None


def _compare(wanted: Said, found: Said) -> str:
    others = [name for name in {**wanted, **found} if found.get(name) is not None and found[name] != wanted.get(name)]
    others += [name for name in wanted if name not in found]
    if others:
        return f"wrong: {', '.join(others)}"
    return "partly" if None in found.values() else "same"


def _plain(values: Iterable[Any]) -> Any:
    """Data of the registrar as lists that can be compared."""
    return [_plain_one(value) for value in values]


def _plain_one(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return value.dtype.str, value.shape, value.tobytes()
    if isinstance(value, (tuple, list)):
        return [_plain_one(item) for item in value]
    if hasattr(value, "__dataclass_fields__"):
        return [(name, _plain_one(getattr(value, name))) for name in value.__dataclass_fields__]
    return value
