// SPDX-License-Identifier: Apache-2.0
// The kernels of free_space.py.
#pragma once
#include "objreg_ros/native/binding.hpp"
#include "objreg_ros/registration/kernels/native/projection.hpp"

namespace objreg::free_space {
constexpr double SHADELESS = 1e6;  // the shade of a point at a depth jump, as in views.py
// What `count` counts, in the order of its result, as in free_space.py.
enum { SEEN, INLIERS, VIOLATIONS, OCCLUDED, SHADED, SUM_A, SUM_B, SUM_AA, SUM_BB, SUM_AB, COUNTS };
using Counts = std::array<double, COUNTS>;
using Camera = std::array<double, 4>;  // fx fy cx cy
using Image = std::tuple<View<const float, 2>, View<const float, 2>, View<const float, 2>, Camera>;  // near far detail

inline Counts counts_of(View<const double, 1> given) {
  Counts out;
  for (int k = 0; k < COUNTS; k++) out[k] = given(k);
  return out;
}

// Count what an image says of `points` moved by `T (4, 4)`: in the order SEEN ... SUM_AB. A depth agrees within
// tolerance + growth z^2; the sums are of the shades of the inliers (A) and of the detail where they land (B).
inline Counts counted(View<const float, 2> points, View<const float, 1> shades, View<const double, 2> T,
                      View<const float, 2> near, View<const float, 2> far, View<const float, 2> detail,
                      const Camera &camera, double tolerance, double growth) {
  i64 inliers = 0, violations = 0, occluded = 0, n = 0;
  double a = 0.0, b = 0.0, aa = 0.0, bb = 0.0, ab = 0.0;
  const projection::Places at = projection::project(points, T, camera);
  Array<u32, 1> found(points.size());
  constexpr i64 BLOCK = projection::BLOCK;
  const double right = near.shape[1] - 1.001, bottom = near.shape[0] - 1.001;
  i32 rows[BLOCK], columns[BLOCK];
  i64 lands[BLOCK], compared[BLOCK];
  float lows[BLOCK], highs[BLOCK];
  const i64 most = near.shape[0] * near.shape[1] > 0 ? points.size() : 0;
  check_slice(0, points.size(), shades.size());
  for (i64 first = 0; first < most; first += BLOCK) {  // each step for several points at a time
    const i64 size = std::min(BLOCK, most - first);
    const double *__restrict us = at.x.data + first, *__restrict vs = at.y.data + first;
    const double *__restrict zs = at.z.data + first;
    const float *__restrict own = shades.data + first;
    for (i64 k = 0; k < size; k++) {
      const double u = us[k], v = vs[k];
      const bool in = (zs[k] >= projection::LEAST_DEPTH) & (u >= 0.0) & (v >= 0.0) & (u <= right) & (v <= bottom);
      lands[k] = in;
      rows[k] = static_cast<i32>(in ? v + 0.5 : 0.0), columns[k] = static_cast<i32>(in ? u + 0.5 : 0.0);
    }
    for (i64 k = 0; k < size; k++) lows[k] = near(rows[k], columns[k]), highs[k] = far(rows[k], columns[k]);
    for (i64 k = 0; k < size; k++) {
      const double z = zs[k], slop = tolerance + growth * z * z;
      const float low = lows[k], high = highs[k];
      const bool measured = (lands[k] != 0) & (high > 0.0f);
      const bool before = measured & (z < low - slop), behind = measured & (z > high + slop);
      const bool between_sides = (z > low + slop) & (z < high - slop);  // of an edge: says nothing
      const bool on = measured & !(before | behind | between_sides);
      violations += before;
      occluded += behind;
      inliers += on;
      compared[k] = on & (own[k] < SHADELESS) & (high - low <= 2.0 * slop);  // silhouettes look alike everywhere
    }
    for (i64 k = 0; k < size; k++) found(n) = static_cast<u32>(first + k), n += compared[k];
  }
  for (i64 k = 0; k < n; k++) {
    const u32 i = found(k);
    const float own = shades(i);
    const double shade = projection::between(detail, at.x(i), at.y(i)).value;
    a += own, b += shade;
    aa += own * own, bb += shade * shade, ab += own * shade;
  }
  const auto number = [](i64 n) { return static_cast<double>(n); };
  return {number(inliers + violations + occluded), number(inliers), number(violations), number(occluded),
          number(n), a, b, aa, bb, ab};
}

// The same for many poses (K, 4, 4): (K, 10).
inline Array<double, 2> count_many(View<const float, 2> points, View<const float, 1> shades, View<const double, 3> T,
                                   View<const float, 2> near, View<const float, 2> far, View<const float, 2> detail,
                                   Camera camera, double tolerance, double growth) {
  Array<double, 2> out(T.size(), static_cast<i64>(COUNTS));
  for (i64 k = 0; k < T.size(); k++) {
    const Counts counts = counted(points, shades, T.row(k), near, far, detail, camera, tolerance, growth);
    for (int what = 0; what < COUNTS; what++) out(k, what) = counts[what];
  }
  return out;
}
inline Array<double, 1> count(View<const float, 2> points, View<const float, 1> shades, View<const double, 2> T,
                              View<const float, 2> near, View<const float, 2> far, View<const float, 2> detail,
                              Camera camera, double tolerance, double growth) {
  const Counts counts = counted(points, shades, T, near, far, detail, camera, tolerance, growth);
  Array<double, 1> out(static_cast<i64>(COUNTS));
  std::copy(counts.begin(), counts.end(), out.data);
  return out;
}

// The normalised correlation -1..1 of the shades in counts; 0 with fewer than 30 of them or none that vary.
inline double correlated(const Counts &counts) {
  const double n = std::max(counts[SHADED], 1.0);
  const double a = counts[SUM_AA] - counts[SUM_A] * counts[SUM_A] / n;
  const double b = counts[SUM_BB] - counts[SUM_B] * counts[SUM_B] / n;
  if (counts[SHADED] < 30.0 || std::min(a, b) <= 1e-6 * n) return 0.0;
  return (counts[SUM_AB] - counts[SUM_A] * counts[SUM_B] / n) / std::sqrt(a * b);
}
inline double correlation(View<const double, 1> counts) { return correlated(counts_of(counts)); }

inline PyMethodDef METHODS[] = {
    binding::method<correlation>("correlation", "The normalised correlation of the shades in counts (10,)."),
    binding::method<count>("count", "The counts (10,) of points under a pose."),
    binding::method<count_many>("count_many", "The counts (K, 10) of points under many poses."),
    {nullptr, nullptr, 0, nullptr},
};
}  // namespace objreg::free_space
