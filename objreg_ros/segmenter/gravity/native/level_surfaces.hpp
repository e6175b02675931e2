// SPDX-License-Identifier: Apache-2.0
// The kernels of level_surfaces.py.
#pragma once
#include "objreg_ros/native/binding.hpp"

namespace objreg::level_surfaces {
constexpr i64 CANDIDATES = 64;
constexpr double ENOUGH = 0.10;  // share of the normals that makes a cluster fully believed
constexpr i64 MIN_NORMALS = 20;

inline double cosine_of(double degrees) { return std::cos(degrees * (3.14159265358979323846 / 180.0)); }
inline const float CLUSTER = static_cast<float>(cosine_of(8.0)), RIVAL = static_cast<float>(cosine_of(16.0));
inline constexpr double CONES[] = {16.0, 12.0, 10.0, 8.0, 6.0, 6.0};  // deg, where a cluster's middle is sought

// The k-th of CANDIDATES normals, spread evenly over `level` (3, N).
inline std::array<float, 3> candidate(View<const float, 2> level, i64 k) {
  const i64 n = k * (level.shape[1] - 1) / (CANDIDATES - 1);
  return {level(0, n), level(1, n), level(2, n)};
}

// How many normals `level` (3, N) lie within the cone of a cluster around one.
inline i64 count_near(View<const float, 2> level, float x, float y, float z) {
  const float *n_x = level.row(0).data, *n_y = level.row(1).data, *n_z = level.row(2).data;
  const float cluster = CLUSTER;
  i32 total = 0;
  for (i64 n = 0; n < level.shape[1]; n++) total += x * n_x[n] + y * n_y[n] + z * n_z[n] > cluster;
  return total;
}

// Turn `up` (3,) to the mean of the normals around it, in shrinking cones.
inline void refine(View<const float, 2> level, View<double, 1> up) {
  const float *n_x = level.row(0).data, *n_y = level.row(1).data, *n_z = level.row(2).data;
  for (const double degrees : CONES) {
    const double cosine = cosine_of(degrees), a = up(0), b = up(1), c = up(2);
    double x = 0.0, y = 0.0, z = 0.0;
    for (i64 n = 0; n < level.shape[1]; n++) {
      const bool near = n_x[n] * a + n_y[n] * b + n_z[n] * c > cosine;
      x += near ? n_x[n] : 0.0;
      y += near ? n_y[n] : 0.0;
      z += near ? n_z[n] : 0.0;
    }
    const double length = std::sqrt(x * x + y * y + z * z);
    if (length == 0.0) break;  // a cone that no normal is in: the cluster is a ring
    up(0) = x / length, up(1) = y / length, up(2) = z / length;
  }
}

// Up (3,) and its confidence, 0 where there is none; NaN where no cluster has a weight.
inline std::tuple<Array<double, 1>, double> estimate(View<const float, 2> normals, View<const float, 1> prior,
                                                     float limit) {
  const i64 size = normals.size();
  Array<float, 2> kept(3, size);
  auto up = zeros<double, 1>(3);
  i64 n = 0;
  for (i64 k = 0; k < size; k++)
    if (normals(k, 0) * prior(0) + normals(k, 1) * prior(1) + normals(k, 2) * prior(2) > limit) {
      for (int axis = 0; axis < 3; axis++) kept(axis, n) = normals(k, axis);
      n++;
    }
  if (n < MIN_NORMALS) return {std::move(up), 0.0};
  const View<const float, 2> level{kept.data, {3, n}, {size, 1}};
  std::array<double, CANDIDATES> count, weight;
  i64 best = 0;
  for (i64 k = 0; k < CANDIDATES; k++) {
    const auto [x, y, z] = candidate(level, k);
    count[k] = count_near(level, x, y, z);
    const double cosine = std::max<double>(x * prior(0) + y * prior(1) + z * prior(2), 0);
    weight[k] = count[k] * cosine * cosine * cosine * cosine;
    if (weight[k] > weight[best]) best = k;
  }
  const auto middle = candidate(level, best);
  for (int axis = 0; axis < 3; axis++) up(axis) = middle[axis];
  refine(level, up);
  double rival = 0.0;
  for (i64 k = 0; k < CANDIDATES; k++) {
    const auto [x, y, z] = candidate(level, k);
    if (x * up(0) + y * up(1) + z * up(2) < RIVAL) rival = std::max(rival, weight[k]);
  }
  const double confidence = (1.0 - rival / weight[best]) * std::min(1.0, count[best] / (ENOUGH * size));
  return {std::move(up), confidence};
}

// (N, 3) the normals that are known among every `stride`-th one of `normals` (3, h, w).
inline Array<float, 2> known_normals(View<const float, 3> normals, i64 stride) {
  const i64 h = normals.shape[1], w = normals.shape[2];
  Array<float, 2> known((h + stride - 1) / stride * ((w + stride - 1) / stride), 3);
  i64 n = 0;
  for (i64 i = 0; i < h; i += stride)
    for (i64 j = 0; j < w; j += stride)
      if (normals(2, i, j) != 0) {
        for (int k = 0; k < 3; k++) known(n, k) = normals(k, i, j);
        n++;
      }
  return std::move(known).first(n);
}

inline PyMethodDef METHODS[] = {
    binding::method<estimate>("estimate", "Up and its confidence."),
    binding::method<known_normals>("known_normals", "The normals that are known among every stride-th one."),
    {nullptr, nullptr, 0, nullptr},
};
}  // namespace objreg::level_surfaces
