# SPDX-License-Identifier: Apache-2.0
"""JSON that is almost good: one place or more of a value at another value, as text."""

from __future__ import annotations

import json
import math
import random
from collections.abc import Iterator
from copy import deepcopy
from typing import Any

DEEP = 100_000
VALUES: tuple[Any, ...] = (
    None, True, False, "", "text", "\ud800", "\0\x1b[2J", "../../x", "x" * 100_000, -1, 0, 1, 0.5, -0.0, 1 << 31,
    1 << 53, 2**63 - 1, 1 << 63, 1 << 80, -(1 << 80), 1e-300, 1e308, math.inf, -math.inf, math.nan, [], {}, [None],
    {"a": None}, [[]] * 1000, [0] * 5000,
)  # fmt: skip


def edited(draw: random.Random, value: Any) -> Any:
    """A copy with some places changed, left out or doubled."""
    made = deepcopy(value)
    for _ in range(draw.choice((1, 1, 1, 2, 4))):
        places = list(_places(made))
        if places:
            _edit(draw, *draw.choice(places))
    return made


def edited_text(draw: random.Random, value: Any) -> str:
    """The same as text, now and then such as is no JSON, or nested deeply."""
    text = json.dumps(edited(draw, value))
    how = draw.random()
    if how < 0.05:
        return text[: draw.randrange(len(text) + 1)]
    if how < 0.1:
        at = draw.randrange(len(text) + 1)
        return text[:at] + draw.choice(("[" * DEEP, "{" * 10, "9" * 5000, "\0", '"', "1e999", "NaN")) + text[at:]
    return text


def _places(value: Any) -> Iterator[tuple[Any, Any]]:
    """Every container and key below a value."""
    inner = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, one in inner:
        yield value, key
        yield from _places(one)


def _edit(draw: random.Random, container: Any, key: Any) -> None:
    how, old = draw.random(), container[key]
    if how < 0.1:
        del container[key]
    elif how < 0.2 and isinstance(container, list):
        container.append(deepcopy(old))
    elif how < 0.4 and isinstance(old, int | float) and not isinstance(old, bool):
        container[key] = draw.choice((-old, old + 1, old - 1, 1e9 * old, old + 0.5, float(old)))
    else:
        container[key] = deepcopy(draw.choice(VALUES))
