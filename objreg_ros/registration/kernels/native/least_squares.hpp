// SPDX-License-Identifier: Apache-2.0
// The kernels of least_squares.py: normal equations, their sums, their solution, and the step of a pose that it is.
#pragma once
#include "objreg_ros/native/binding.hpp"

namespace objreg::least_squares {
// Add row and column K of the normal equations, as far as the diagonal: all sums of a row in one pass.
template <int K> void add_row(const double *const (&J)[6], const double *__restrict error,
                              const double *__restrict weight, i64 n, View<double, 2> H, View<double, 1> g) {
  const double *__restrict own = J[K];
  double pull = 0.0, totals[K + 1] = {};
  for (i64 i = 0; i < n; i++) {
    const double weighed = weight[i] * own[i];
    pull += weighed * error[i];
    for (int m = 0; m <= K; m++) totals[m] += weighed * J[m][i];
  }
  g(K) += pull;
  for (int m = 0; m <= K; m++) {
    H(K, m) += totals[m];
    if (m != K) H(m, K) += totals[m];
  }
}

// Add to H (6, 6) and g (6,) those of errors (n,) with a weight and the rows (n,) of a Jacobian.
inline void add_rows(const double *const (&J)[6], const double *error, const double *weight, i64 n, View<double, 2> H,
                     View<double, 1> g) {
  add_row<0>(J, error, weight, n, H, g), add_row<1>(J, error, weight, n, H, g), add_row<2>(J, error, weight, n, H, g);
  add_row<3>(J, error, weight, n, H, g), add_row<4>(J, error, weight, n, H, g), add_row<5>(J, error, weight, n, H, g);
}
template <i64 SIZE> void add_block(const double (&J)[6][SIZE], const double (&error)[SIZE],
                                   const double (&weight)[SIZE], i64 n, View<double, 2> H, View<double, 1> g) {
  check_slice(0, n, SIZE);
  const double *const rows[6] = {J[0], J[1], J[2], J[3], J[4], J[5]};
  add_rows(rows, error, weight, n, H, g);
}
inline void add_normal_equations(View<const double, 2> J, View<const double, 1> error, View<const double, 1> weight,
                                 View<double, 2> H, View<double, 1> g) {
  const i64 n = error.size();
  check_slice(0, n, J.shape[1]), check_slice(0, n, weight.size());
  const double *const rows[6] = {J.row(0).data, J.row(1).data, J.row(2).data,
                                 J.row(3).data, J.row(4).data, J.row(5).data};
  add_rows(rows, error.data, weight.data, n, H, g);
}

// Turn `b` (n,) into the x of A x = b for a positive definite `A` (n, n), by Cholesky; A is spoilt.
inline void solve(View<double, 2> A, View<double, 1> b) {
  const i64 n = b.size();
  for (i64 i = 0; i < n; i++)
    for (i64 j = 0; j <= i; j++) {
      double value = A(i, j);
      for (i64 k = 0; k < j; k++) value -= A(i, k) * A(j, k);
      A(i, j) = i == j ? std::sqrt(std::max(value, 1e-18)) : value / A(j, j);
    }
  for (i64 i = 0; i < n; i++) {
    for (i64 k = 0; k < i; k++) b(i) -= A(i, k) * b(k);
    b(i) /= A(i, i);
  }
  for (i64 i = n - 1; i >= 0; i--) {
    for (i64 k = i + 1; k < n; k++) b(i) -= A(k, i) * b(k);
    b(i) /= A(i, i);
  }
}

// Move a pose `T` (4, 4) by a left `step` (6,) [t r], in place; returns the largest of its parts.
inline double move(View<double, 2> T, View<const double, 1> step) {
  const double x = step(3), y = step(4), z = step(5), angle = std::sqrt(x * x + y * y + z * z);
  const double sine = angle > 1e-12 ? std::sin(angle) / angle : 1.0;
  const double versed = angle > 1e-6 ? (1.0 - std::cos(angle)) / (angle * angle) : 0.5;
  for (int column = 0; column < 4; column++) {
    const double a = T(0, column), b = T(1, column), c = T(2, column), along = x * a + y * b + z * c;
    const double squared = angle * angle;
    T(0, column) += sine * (y * c - z * b) + versed * (x * along - squared * a);
    T(1, column) += sine * (z * a - x * c) + versed * (y * along - squared * b);
    T(2, column) += sine * (x * b - y * a) + versed * (z * along - squared * c);
  }
  double largest = 0.0;
  for (int k = 0; k < 3; k++) T(k, 3) += step(k);
  for (int k = 0; k < 6; k++) largest = std::max(largest, std::abs(step(k)));
  return largest;
}

// Fill `back` (4, 4) with the inverse of a pose.
inline void invert(View<const double, 2> T, View<double, 2> back) {
  for (int i = 0; i < 3; i++) {
    back(i, 3) = 0.0;
    for (int j = 0; j < 3; j++) {
      back(i, j) = T(j, i);
      back(i, 3) -= T(j, i) * T(j, 3);
    }
  }
  back(3, 0) = back(3, 1) = back(3, 2) = 0.0, back(3, 3) = 1.0;
}

inline PyMethodDef METHODS[] = {
    binding::method<add_normal_equations>("add_normal_equations", "Adds those of weighed errors to H and g."),
    binding::method<move>("move", "Moves a pose T (4, 4) by a left step (6,) in place; the largest of its parts."),
    binding::method<solve>("solve", "Turns b (n,) into the x of A x = b; A is spoilt."),
    {nullptr, nullptr, 0, nullptr},
};
}  // namespace objreg::least_squares
