# SPDX-License-Identifier: Apache-2.0
"""What every picture of the simulator is, whatever it shows."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np


def require_square_and_seeded(draw: Callable[..., np.ndarray]) -> None:
    """A picture is square, of a power of two, and follows from its seed alone."""
    first, again, other = (draw(np.random.default_rng(seed)) for seed in (3, 3, 4))
    size = first.shape[0]
    assert first.shape == (size, size, 3) and first.dtype == np.uint8 and size & (size - 1) == 0
    assert np.array_equal(first, again)
    assert first.shape != other.shape or not np.array_equal(first, other)
