# SPDX-License-Identifier: Apache-2.0
"""A data set as a page: each object with crops from the pictures that it is labelled in, its id and its class."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from objreg_tools.report.labels.crops import Crops
from objreg_tools.report.labels.mapped_objects import MappedObject
from objreg_tools.report.page import environment


def labels_page(
    name: str,
    objects: Sequence[MappedObject],
    classes: Mapping[int, str],
    crops: Mapping[int, Crops],
    counts: Mapping[str, int],
) -> str:
    """The HTML; ``classes`` and ``crops`` by landmark, ``counts`` what the tiles at the top show."""
    rows = [_row(one, classes[one.landmark], crops.get(one.landmark, Crops())) for one in objects]
    rows.sort(key=lambda row: (-row["count"], row["landmark"]))
    return environment().get_template("labels.html.j2").render(name=name, counts=counts, rows=rows)


def _row(one: MappedObject, name: str, crops: Crops) -> dict[str, Any]:
    return {
        "landmark": one.landmark,
        "joined": ", ".join(map(str, one.joined)),
        "name": name,
        "label": one.label,
        "count": crops.count,
        "views": len(one.views),
        "crops": [crop.picture for crop in crops.chosen],
    }
