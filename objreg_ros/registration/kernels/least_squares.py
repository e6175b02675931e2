# SPDX-License-Identifier: Apache-2.0
"""Normal equations: their sums, their solution, and the step of a pose that it is."""

from __future__ import annotations

import numba
import numpy as np

from objreg_ros.registration.kernels.projection import FAST


@numba.njit(cache=True, nogil=True, fastmath=FAST)
def add_normal_equations(J, error, weight, H, g):  # type: ignore[no-untyped-def]
    """Add to H (6, 6) and g (6,) those of errors (n,) with a weight and a Jacobian (6, n)."""
    weighed = np.empty(len(error))
    for k in range(6):
        pull = 0.0
        for i in range(len(error)):
            weighed[i] = weight[i] * J[k, i]
            pull += weighed[i] * error[i]
        g[k] += pull
        for m in range(k + 1):
            total = 0.0
            for i in range(len(error)):
                total += weighed[i] * J[m, i]
            H[k, m] += total
            if m != k:
                H[m, k] += total


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


@numba.njit(cache=True, nogil=True)
def move(T, step):  # type: ignore[no-untyped-def]
    """Move a pose ``T`` (4, 4) by a left ``step`` (6,) [t r], in place; returns the largest of its parts."""
    x, y, z = step[3], step[4], step[5]
    angle = np.sqrt(x * x + y * y + z * z)
    sine = np.sin(angle) / angle if angle > 1e-12 else 1.0
    versed = (1.0 - np.cos(angle)) / (angle * angle) if angle > 1e-6 else 0.5
    for column in range(4):
        a, b, c = T[0, column], T[1, column], T[2, column]
        along = x * a + y * b + z * c
        squared = angle * angle
        T[0, column] += sine * (y * c - z * b) + versed * (x * along - squared * a)
        T[1, column] += sine * (z * a - x * c) + versed * (y * along - squared * b)
        T[2, column] += sine * (x * b - y * a) + versed * (z * along - squared * c)
    largest = 0.0
    for k in range(3):
        T[k, 3] += step[k]
    for k in range(6):
        largest = max(largest, abs(step[k]))
    return largest


@numba.njit(cache=True, nogil=True)
def invert(T, back):  # type: ignore[no-untyped-def]
    """Fill ``back`` (4, 4) with the inverse of a pose."""
    for i in range(3):
        back[i, 3] = 0.0
        for j in range(3):
            back[i, j] = T[j, i]
            back[i, 3] -= T[j, i] * T[j, 3]
