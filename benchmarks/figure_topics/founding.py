# SPDX-License-Identifier: Apache-2.0
"""The topic of the founding document: its two tables and its figure 10, its method here, and ours."""

from __future__ import annotations

from functools import partial
from typing import Any

from figure_topics.topic import Row, Topic, Values

METHODS = {"its ICP": "founding", "ours": "ours"}
OBJECTS = ("cap", "cereal_box", "soda_can", "chair", "monitor", "bowl", "flashlight", "book", "keyboard")  # of table 1


def _angles(raw: Any) -> Values:
    rows = raw["by_angle"]
    show = lambda name: ", ".join(f"{row[name]:.2f}" for row in rows.values())  # noqa: E731
    return {"ours": show("ours"), "founding": show("founding"), "angles": ", ".join(f"{angle}°" for angle in rows)}


def _time(raw: Any) -> Values:
    return {"ms": round(raw["time"]["ours_cpu_ms"], 1), "times": round(raw["time"]["ratio_paper_cpu_ms"])}


def _pair(raw: Any, name: str) -> Values:
    """A row of table 1."""
    cell = next(cell for cell in raw["table_1"] if cell["object"] == name)
    errors = [f"{title} {_errors(cell[method])}" for title, method in METHODS.items()]
    return {"errors": "; ".join([f"stated {1e3 * cell['document_m']:.3g}", *errors])}


def _errors(found: Any) -> str:
    """The error of alignment in mm, and the true one; a method can be without an answer."""
    if found["error_m"] is None:
        return "none"
    return f"{1e3 * found['error_m']:.1f} ({found['rotation_deg']:.1f}°, {found['translation_cm']:.1f} cm)"


def _sweep(raw: Any) -> Values:
    """How many of table 2 each method gets right, object by object."""
    rows = raw["table_2"].items()
    return {"right": "; ".join(f"{name.replace('_', ' ')}: {_shares(cells)}" for name, cells in rows)}


def _shares(cells: Any) -> str:
    mean = lambda method: sum(cell[method]["success"] for cell in cells) / len(cells)  # noqa: E731
    return ", ".join(f"{title} {mean(method):.2f}" for title, method in METHODS.items())


TOPICS = (
    Topic(
        name="paper",
        title="The founding document's pairs",
        script="benchmarks/paper.py --seed 20",
        quick="--quick",
        whole="--seeds 3 --figure docs/pictures/founding.svg",
        minutes=(0.7, 3),
        rows=(
            Row("right", "right, by angle of view", "{ours} at {angles}; its ICP {founding}", _angles),
            Row("time", "a pair, preparation apart, and over its 2 s", "{ms} ms, {times} × faster", _time),
            *(
                Row(f"table_1_{name}", f"table 1: {name.replace('_', ' ')}", "{errors}", partial(_pair, name=name))
                for name in OBJECTS
            ),
            Row("table_2", "table 2, all angles: right", "{right}", _sweep),
        ),
        about="Errors are the document's: the mean distance in mm to the closest point, medians over the seeds; in "
        "brackets the true error of the pose.",
        picture="docs/pictures/founding.svg",
    ),
)
