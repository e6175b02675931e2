# SPDX-License-Identifier: Apache-2.0
"""How far work on many recordings is, in frames. Recordings that have not begun are taken to be as long as the mean."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from threading import Lock

from tqdm import tqdm


class Progress:
    """Frames done, and frames in all, of so many items; the first says how many it has with its first report."""

    def __init__(self, items: int) -> None:
        self._items = items
        self._done: dict[int, int] = {}
        self._total: dict[int, int] = {}
        self._ended: set[int] = set()

    def receive(self, number: int, done: int, total: int) -> None:
        """A report of an item; one that comes late, or from a worker that began it anew, counts as it is."""
        self._total[number] = max(total, done)
        self._done[number] = done

    def end(self, number: int) -> None:
        """An item has ended, with all its frames or before."""
        self._ended.add(number)

    @property
    def done(self) -> int:
        """Frames that are through; all of an item that has ended."""
        return sum(self._total[k] if k in self._ended else done for k, done in self._done.items())

    @property
    def total(self) -> int | None:
        """Frames in all, those that are not counted yet estimated; None before any is known."""
        if not self._total:
            return None
        known = sum(self._total.values())
        unknown = self._items - len(self._total.keys() | self._ended)
        return known + round(unknown * known / len(self._total))


class FrameBar:
    """A progress bar of frames. Its methods may be called from several threads."""

    def __init__(self, bar: tqdm, items: int) -> None:
        self._bar, self._progress, self._lock, self._ended = bar, Progress(items), Lock(), 0
        self._items = items

    def receive(self, number: int, done: int, total: int) -> None:
        """As `Progress.receive`."""
        with self._lock:
            self._progress.receive(number, done, total)
            self._show()

    def end(self, number: int) -> None:
        """As `Progress.end`."""
        with self._lock:
            self._progress.end(number)
            self._ended += 1
            self._bar.set_postfix_str(f"{self._ended} of {self._items} ended", refresh=False)
            self._show()

    def write(self, text: str, file: object) -> None:
        """A line above the bar."""
        self._bar.write(text, file=file)

    def _show(self) -> None:
        self._bar.total = self._progress.total
        self._bar.n = self._progress.done
        self._bar.refresh()


@contextmanager
def frame_bar(items: int) -> Iterator[FrameBar]:
    """A bar over so many items, which goes when the block ends; nothing is drawn where there is no terminal."""
    with tqdm(total=None, unit="frame", disable=None, leave=False) as bar:
        yield FrameBar(bar, items)
