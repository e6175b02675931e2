// SPDX-License-Identifier: Apache-2.0
// The kernels of shape.py, and a shape as kernels see it.
#pragma once
#include "objreg_ros/native/binding.hpp"
#include "objreg_ros/registration/shapes/native/silhouette.hpp"

namespace objreg::shape {
constexpr double LEVEL = 0.9;  // cosine of a surface that objects stand on with up

// `Shape.kernel_arrays`: points, normals and shades; R_upright_camera and the origin; depth, mask, grey, camera,
// tolerance, inward and edges of the silhouette.
using Arrays = std::tuple<View<const float, 2>, View<const float, 2>, View<const float, 1>, View<const double, 2>,
                          View<const double, 1>, View<const float, 2>, View<const u8, 2>, View<const float, 2>,
                          View<const double, 1>, View<const double, 1>, View<const silhouette::i16, 3>,
                          View<const bool, 1>>;

// The points (n, 3) of level surfaces in upright axes: within a box, beyond another, between two heights. A box (2, 2)
// is the least and the most of x and y.
inline Array<float, 2> level(View<const float, 2> xyz, View<const float, 2> normals, View<const float, 2> R,
                             View<const float, 2> within, View<const float, 2> beyond, double low, double high) {
  Array<float, 2> found(xyz.size(), 3);
  const float xx = R(0, 0), xy = R(0, 1), xz = R(0, 2), yx = R(1, 0), yy = R(1, 1), yz = R(1, 2);
  const float zx = R(2, 0), zy = R(2, 1), zz = R(2, 2);
  const float west = within(0, 0), south = within(0, 1), east = within(1, 0), north = within(1, 1);
  const float left = beyond(0, 0), front = beyond(0, 1), right = beyond(1, 0), back = beyond(1, 1);
  i64 n = 0;
  for (i64 i = 0; i < xyz.size(); i++) {
    if (zx * normals(i, 0) + zy * normals(i, 1) + zz * normals(i, 2) <= LEVEL) continue;
    const float a = xyz(i, 0), b = xyz(i, 1), c = xyz(i, 2);
    const float x = xx * a + xy * b + xz * c, y = yx * a + yy * b + yz * c, z = zx * a + zy * b + zz * c;
    const bool inside = (x > west) & (y > south) & (x < east) & (y < north);
    const bool outside = (x < left) | (y < front) | (x > right) | (y > back);
    found(n, 0) = x, found(n, 1) = y, found(n, 2) = z;
    n += inside & outside & (z > low) & (z < high);
  }
  return std::move(found).first(n);
}

inline PyMethodDef METHODS[] = {
    binding::method<level>("level", "The points (n, 3) of level surfaces in upright axes."),
    {nullptr, nullptr, 0, nullptr},
};
}  // namespace objreg::shape
