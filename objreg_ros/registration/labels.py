# SPDX-License-Identifier: Apache-2.0
"""Which labels may stand for the same object: detectors split one object into cup and mouse, book and remote."""

from __future__ import annotations

from collections.abc import Iterable


class LabelGroups:
    """Names the group of each label. An item of ``groups`` lists labels with spaces between, ``_`` for a space in one.

    A label of no group is a group of its own. ValueError if a label is in two groups.
    """

    def __init__(self, groups: Iterable[str]) -> None:
        self._of: dict[str, str] = {}
        for group in groups:
            names = [name.replace("_", " ") for name in group.split()]
            for name in names:
                if name in self._of:
                    raise ValueError(f"label_groups: expected each label in one group, got {name!r} in two")
                self._of[name] = names[0]

    def of(self, label: str) -> str:
        """The group of a label: the first label of its group."""
        return self._of.get(label, label)
