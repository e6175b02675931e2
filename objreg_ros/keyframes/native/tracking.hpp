// SPDX-License-Identifier: Apache-2.0
// The kernels of tracking.py.
#pragma once
#include "objreg_ros/native/binding.hpp"

namespace objreg::tracking {
constexpr double HUBER = 1.3;  // standard deviations beyond which an error counts linearly
constexpr i64 LEAST_PAIRS = 200;

inline double huber(double scaled) {
  const double size = std::abs(scaled);
  return size < HUBER ? 1.0 : HUBER / size;
}

// Add an error with the gradient (a, b, c) at the point (x, y, z) that moves; the upper triangle of H only.
inline void add(View<double, 2> H, View<double, 1> g, double x, double y, double z, double a, double b, double c,
                double error, double weight) {
  const double J[6] = {a, b, c, y * c - z * b, z * a - x * c, x * b - y * a};
  for (int i = 0; i < 6; i++) {
    const double weighted = weight * J[i];
    g(i) += weighted * error;
    for (int j = i; j < 6; j++) H(i, j) += weighted * J[j];
  }
}

// The upper triangle of J^T W J and J^T W e of a step that multiplies from the left; with them the number of pairs, of
// pixels that could have been one, and how much brighter the target is. `deviation` (2,) of depth: m, and its growth.
inline std::tuple<Array<double, 2>, Array<double, 1>, i64, i64, double> normal_equations(
    View<const float, 2> xyz, View<const float, 1> grey, View<const double, 2> T, View<const float, 3> target_xyz,
    View<const float, 3> normals, View<const float, 2> target_grey, View<const float, 3> slope,
    View<const double, 1> camera, double reach, double grey_weight, double exposure, std::array<double, 2> deviation) {
  auto H = zeros<double, 2>(6, 6);
  auto g = zeros<double, 1>(6);
  const i64 height = target_grey.shape[0], width = target_grey.shape[1];
  const double fx = camera(0), fy = camera(1), cx = camera(2), cy = camera(3);
  i64 pairs = 0, seen = 0;
  double brightness = 0.0, weights = 0.0;
  for (i64 k = 0; k < xyz.size(); k++) {
    const double x = T(0, 0) * xyz(k, 0) + T(0, 1) * xyz(k, 1) + T(0, 2) * xyz(k, 2) + T(0, 3);
    const double y = T(1, 0) * xyz(k, 0) + T(1, 1) * xyz(k, 1) + T(1, 2) * xyz(k, 2) + T(1, 3);
    const double z = T(2, 0) * xyz(k, 0) + T(2, 1) * xyz(k, 1) + T(2, 2) * xyz(k, 2) + T(2, 3);
    const double u = fx * x / z + cx, v = fy * y / z + cy;
    if (!(z >= 0.1 && u >= 0.0 && v >= 0.0 && u <= width - 1.0 && v <= height - 1.0)) continue;
    const i64 i = static_cast<i64>(v + 0.5), j = static_cast<i64>(u + 0.5);
    const double nx = normals(i, j, 0), ny = normals(i, j, 1), nz = normals(i, j, 2);
    if (nx == 0.0 && ny == 0.0 && nz == 0.0) continue;
    seen++;
    const double distance =
        (x - target_xyz(i, j, 0)) * nx + (y - target_xyz(i, j, 1)) * ny + (z - target_xyz(i, j, 2)) * nz;
    if (std::abs(distance) > reach) continue;
    pairs++;
    const double precision = 1.0 / (deviation[0] + deviation[1] * z * z);
    add(H, g, x, y, z, nx, ny, nz, distance, precision * precision * huber(distance * precision));
    if (grey_weight > 0.0) {
      double a = slope(i, j, 0), b = slope(i, j, 1);
      const double error = target_grey(i, j) + a * (u - j) + b * (v - i) - grey(k) - exposure;
      const double weight = grey_weight * grey_weight * huber(error * grey_weight);
      a = a * fx / z, b = b * fy / z;
      add(H, g, x, y, z, a, b, -(a * x + b * y) / z, error, weight);
      brightness += weight * error;
      weights += weight;
    }
  }
  return {std::move(H), std::move(g), pairs, std::max<i64>(seen, 1), brightness / std::max(weights, 1e-12)};
}

// The correlation of grey over the pixels that land on known depth, and the deviation of what they land on: 0 and inf
// for fewer than LEAST_PAIRS.
inline std::tuple<double, double> correlation(View<const float, 2> xyz, View<const float, 1> grey,
                                              View<const double, 2> T, View<const float, 3> target_xyz,
                                              View<const float, 2> target_grey, View<const double, 1> camera) {
  const i64 height = target_grey.shape[0], width = target_grey.shape[1];
  i64 n = 0;
  double a = 0.0, b = 0.0, aa = 0.0, bb = 0.0, ab = 0.0;
  for (i64 k = 0; k < xyz.size(); k++) {
    const double z = T(2, 0) * xyz(k, 0) + T(2, 1) * xyz(k, 1) + T(2, 2) * xyz(k, 2) + T(2, 3);
    if (!(z >= 0.1)) continue;
    const double x = T(0, 0) * xyz(k, 0) + T(0, 1) * xyz(k, 1) + T(0, 2) * xyz(k, 2) + T(0, 3);
    const double y = T(1, 0) * xyz(k, 0) + T(1, 1) * xyz(k, 1) + T(1, 2) * xyz(k, 2) + T(1, 3);
    const double u = camera(0) * x / z + camera(2), v = camera(1) * y / z + camera(3);
    if (!(u >= 0.0 && v >= 0.0 && u <= width - 1.0 && v <= height - 1.0)) continue;
    const i64 i = static_cast<i64>(v + 0.5), j = static_cast<i64>(u + 0.5);
    if (!(target_xyz(i, j, 2) > 0.0f)) continue;
    const double here = grey(k), there = target_grey(i, j);
    n++, a += here, b += there;
    aa += here * here, bb += there * there, ab += here * there;
  }
  if (n < LEAST_PAIRS) return {0.0, std::numeric_limits<double>::infinity()};
  const double here = aa - a * a / n, there = bb - b * b / n;
  const double found = here * there > 0.0 ? (ab - a * b / n) / std::sqrt(here * there) : 0.0;
  return {found, std::sqrt(std::max(there / n, 0.0))};
}

inline PyMethodDef METHODS[] = {
    binding::method<normal_equations>("normal_equations", "H, g, pairs, seen and how much brighter the target is."),
    binding::method<correlation>("correlation", "The correlation of grey, and the deviation of the target's."),
    {nullptr, nullptr, 0, nullptr},
};
}  // namespace objreg::tracking
