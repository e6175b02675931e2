# SPDX-License-Identifier: Apache-2.0
"""Normal equations: their sums, their solution, and the step of a pose that it is."""

from __future__ import annotations

from objreg_ros.native import kernels

_KERNELS = kernels("least_squares")
add_normal_equations = _KERNELS.add_normal_equations  # (J, error, weight, H, g): add to H (6, 6) and g (6,)
move = _KERNELS.move  # (T, step): move a pose T (4, 4) by a left step (6,) in place; the largest of its parts
solve = _KERNELS.solve  # (A, b): turn b (n,) into the x of A x = b for a positive definite A (n, n); A is spoilt
