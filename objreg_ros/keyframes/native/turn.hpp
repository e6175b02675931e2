// SPDX-License-Identifier: Apache-2.0
// The kernel of turn.py.
#pragma once
#include "objreg_ros/native/binding.hpp"

namespace objreg::turn {
// The normal equations of a turn from the left and of the exposure; the difference, and the share that overlaps.
inline std::tuple<Array<double, 2>, Array<double, 1>, double, double> equations(
    View<const float, 2> grey, View<const double, 1> camera, View<const double, 2> R, View<const float, 2> target,
    View<const float, 3> slope, View<const double, 1> target_camera) {
  auto H = zeros<double, 2>(4, 4);
  auto g = zeros<double, 1>(4);
  double J[4] = {0.0, 0.0, 0.0, -1.0};
  const i64 rows = grey.shape[0], columns = grey.shape[1], height = target.shape[0], width = target.shape[1];
  const double fx = target_camera(0), fy = target_camera(1), cx = target_camera(2), cy = target_camera(3);
  i64 count = 0;
  double total = 0.0, squares = 0.0;
  for (i64 i = 0; i < rows; i++)
    for (i64 j = 0; j < columns; j++) {
      const double a = (j - camera(2)) / camera(0), b = (i - camera(3)) / camera(1);
      const double x = R(0, 0) * a + R(0, 1) * b + R(0, 2);
      const double y = R(1, 0) * a + R(1, 1) * b + R(1, 2);
      const double z = R(2, 0) * a + R(2, 1) * b + R(2, 2);
      if (!(z >= 0.1)) continue;
      const double u = fx * x / z + cx, v = fy * y / z + cy;
      if (!(u >= 0.0 && v >= 0.0 && u <= width - 1.0 && v <= height - 1.0)) continue;
      const i64 m = std::min(static_cast<i64>(v), height - 2), n = std::min(static_cast<i64>(u), width - 2);
      const double p = v - m, q = u - n;
      const double w00 = (1 - p) * (1 - q), w01 = (1 - p) * q, w10 = p * (1 - q), w11 = p * q;
      const double there =
          w00 * target(m, n) + w01 * target(m, n + 1) + w10 * target(m + 1, n) + w11 * target(m + 1, n + 1);
      double sx = w00 * slope(m, n, 0) + w01 * slope(m, n + 1, 0) + w10 * slope(m + 1, n, 0) + w11 * slope(m + 1, n + 1, 0);
      double sy = w00 * slope(m, n, 1) + w01 * slope(m, n + 1, 1) + w10 * slope(m + 1, n, 1) + w11 * slope(m + 1, n + 1, 1);
      const double error = there - grey(i, j);
      sx = sx * fx / z, sy = sy * fy / z;
      const double sz = -(sx * x + sy * y) / z;
      J[0] = y * sz - z * sy, J[1] = z * sx - x * sz, J[2] = x * sy - y * sx;
      count++;
      total += error;
      squares += error * error;
      for (int s = 0; s < 4; s++) {
        g(s) += J[s] * error;
        for (int t = 0; t < 4; t++) H(s, t) += J[s] * J[t];
      }
    }
  const double n = static_cast<double>(std::max<i64>(count, 1)), mean = total / n;
  const double spread = std::sqrt(std::max(squares / n - mean * mean, 0.0));
  return {std::move(H), std::move(g), spread, static_cast<double>(count) / static_cast<double>(rows * columns)};
}

inline PyMethodDef METHODS[] = {
    binding::method<equations>("equations", "H, g, the difference of the pictures and the share that overlaps."),
    {nullptr, nullptr, 0, nullptr},
};
}  // namespace objreg::turn
