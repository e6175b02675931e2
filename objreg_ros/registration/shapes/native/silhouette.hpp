// SPDX-License-Identifier: Apache-2.0
// The kernels of silhouette.py.
#pragma once
#include "objreg_ros/native/binding.hpp"

namespace objreg::silhouette {
using i16 = std::int16_t;
constexpr u8 BESIDE = 0, INSIDE = 1, RIM = 2;  // the values of a silhouette's mask, as in silhouette.py

// (h, w, 2): from each pixel to the one of the mask that has its label.
inline Array<i16, 3> ways(View<const u8, 2> mask, View<const i32, 2> nearest, i64 labels) {
  const i64 height = mask.shape[0], width = mask.shape[1];
  auto lookup = zeros<i16, 2>(labels, 2);
  Array<i16, 3> out(height, width, 2);
  for (i64 row = 0; row < height; row++)
    for (i64 column = 0; column < width; column++)
      if (mask(row, column)) {
        const i64 at = nearest(row, column);
        lookup(at, 0) = static_cast<i16>(column), lookup(at, 1) = static_cast<i16>(row);
      }
  for (i64 row = 0; row < height; row++)
    for (i64 column = 0; column < width; column++) {
      const i64 at = nearest(row, column);
      out(row, column, 0) = static_cast<i16>(lookup(at, 0) - column);
      out(row, column, 1) = static_cast<i16>(lookup(at, 1) - row);
    }
  return out;
}

// Every point claims its pixel where it is the nearest.
inline void splat(View<const double, 1> u, View<const double, 1> v, View<const float, 1> z, View<const float, 1> grey,
                  View<float, 2> depth, View<float, 2> shade) {
  const double height = depth.shape[0], width = depth.shape[1];
  for (i64 i = 0; i < z.size(); i++) {
    if (!(v(i) > -1.0 && v(i) < height && u(i) > -1.0 && u(i) < width)) continue;
    const i64 row = static_cast<i64>(v(i)), column = static_cast<i64>(u(i));
    if (!(z(i) < depth(row, column))) continue;
    depth(row, column) = z(i);
    shade(row, column) = grey(i);
  }
}

inline PyMethodDef METHODS[] = {
    binding::method<ways>("ways", "(h, w, 2) int16: from each pixel to the one of the mask that has its label."),
    binding::method<splat>("splat", "Every point claims its pixel where it is the nearest."),
    {nullptr, nullptr, 0, nullptr},
};
}  // namespace objreg::silhouette
