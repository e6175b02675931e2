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
  i64 n = 0;
  for (i64 i = 0; i < xyz.size(); i++) {
    if (R(2, 0) * normals(i, 0) + R(2, 1) * normals(i, 1) + R(2, 2) * normals(i, 2) <= LEVEL) continue;
    for (int k = 0; k < 3; k++) found(n, k) = R(k, 0) * xyz(i, 0) + R(k, 1) * xyz(i, 1) + R(k, 2) * xyz(i, 2);
    const float x = found(n, 0), y = found(n, 1), z = found(n, 2);
    const bool inside = (x > within(0, 0)) & (y > within(0, 1)) & (x < within(1, 0)) & (y < within(1, 1));
    const bool outside = (x < beyond(0, 0)) | (y < beyond(0, 1)) | (x > beyond(1, 0)) | (y > beyond(1, 1));
    n += inside & outside & (z > low) & (z < high);
  }
  return std::move(found).first(n);
}

inline PyMethodDef METHODS[] = {
    binding::method<level>("level", "The points (n, 3) of level surfaces in upright axes."),
    {nullptr, nullptr, 0, nullptr},
};
}  // namespace objreg::shape
