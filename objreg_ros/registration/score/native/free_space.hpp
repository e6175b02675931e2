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
  Array<u32, 1> found = projection::landing(at.x, at.y, at.z, near);
  for (i64 k = 0; k < found.size(); k++) {
    const u32 i = found(k);
    const double z = at.z(i), slop = tolerance + growth * z * z;
    const projection::Pixel pixel = projection::nearest(at.x(i), at.y(i));
    const float low = near(pixel.row, pixel.column), high = far(pixel.row, pixel.column);
    const bool measured = high > 0.0f;
    const bool before = measured & (z < low - slop), behind = measured & (z > high + slop);
    const bool between_sides = (z > low + slop) & (z < high - slop);  // of an edge: says nothing
    const bool on = measured & !(before | behind | between_sides);
    violations += before;
    occluded += behind;
    inliers += on;
    found(n) = i;
    n += on & (shades(i) < SHADELESS) & (high - low <= 2.0 * slop);  // silhouettes look alike everywhere
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
