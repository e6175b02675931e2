# SPDX-License-Identifier: Apache-2.0
"""Normal equations: their sums, their solution, and the step of a pose that it is."""

from __future__ import annotations

import numba
import numpy as np

from objreg_ros.native import kernels

_KERNELS = kernels("least_squares")
add_normal_equations = _KERNELS.add_normal_equations  # (J, error, weight, H, g): add to H (6, 6) and g (6,)
move = _KERNELS.move  # (T, step): move a pose T (4, 4) by a left step (6,) in place; the largest of its parts


@numba.njit(cache=True, nogil=True)
def solve(A, b):  # type: ignore[no-untyped-def]
    """Turn ``b`` (n,) into the x of A x = b for a positive definite ``A`` (n, n), by Cholesky; A is spoilt.

    Plain loops: they compile in a tenth of the time of numpy's solver.
    """
    n = len(b)
    for i in range(n):
        for j in range(i + 1):
            value = A[i, j]
            for k in range(j):
                value -= A[i, k] * A[j, k]
            A[i, j] = np.sqrt(max(value, 1e-18)) if i == j else value / A[j, j]
    for i in range(n):
        for k in range(i):
            b[i] -= A[i, k] * b[k]
        b[i] /= A[i, i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            b[i] -= A[k, i] * b[k]
        b[i] /= A[i, i]
