// SPDX-License-Identifier: Apache-2.0
// solve_symmetric of support.py, which flags.py takes too.
#pragma once
#include "objreg_ros/native/array.hpp"

namespace objreg::support {
// The solution of M x = v, with M symmetric, given as its upper triangle row by row: Cramer's rule.
inline std::array<double, 3> solve_symmetric(std::array<double, 6> M, std::array<double, 3> v) {
  const double a = M[0], b = M[1], c = M[2], d = M[3], e = M[4], f = M[5];
  const double p = d * f - e * e, q = c * e - b * f, r = b * e - c * d;
  const double determinant = a * p + b * q + c * r;
  return {(p * v[0] + q * v[1] + r * v[2]) / determinant,
          (q * v[0] + (a * f - c * c) * v[1] + (b * c - a * e) * v[2]) / determinant,
          (r * v[0] + (b * c - a * e) * v[1] + (a * d - b * b) * v[2]) / determinant};
}
}  // namespace objreg::support
