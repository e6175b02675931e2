// SPDX-License-Identifier: Apache-2.0
// The kernels of registered_depth.py.
#pragma once
#include "objreg_ros/native/binding.hpp"

namespace objreg::registered_depth {
constexpr float SAME_SURFACE = 0.03f;  // of depth, between two pixels side by side; a grazing wall has less
constexpr float NEAREST_M = 0.05f;     // before the other camera; nothing is measured nearer
constexpr float MOST_REACH = 8.0f;     // px from the middle of what one pixel covers

// Where each pixel is in the other picture, and its depth there; 0 where there is none.
inline void project(View<const float, 2> depth, View<const float, 2> across, View<const float, 2> down,
                    View<const float, 1> t, View<const float, 1> K, View<float, 3> uvz) {
  const float fx = K(0), fy = K(1), cx = K(2), cy = K(3);
  for (i64 row = 0; row < depth.shape[0]; row++)
    for (i64 column = 0; column < depth.shape[1]; column++) {
      const float z = depth(row, column);
      const float ahead = z * (across(2, column) + down(2, row)) + t(2);
      if (!(z > 0 && ahead > NEAREST_M)) {
        uvz(row, column, 2) = 0;
        continue;
      }
      uvz(row, column, 0) = fx * (z * (across(0, column) + down(0, row)) + t(0)) / ahead + cx;
      uvz(row, column, 1) = fy * (z * (across(1, column) + down(1, row)) + t(1)) / ahead + cy;
      uvz(row, column, 2) = ahead;
    }
}

// Lay each pixel over what it covers, from its own square on to the squares of the pixels right and below.
inline void splat(View<const float, 2> depth, View<const float, 3> uvz, View<const float, 2> steps,
                  View<const float, 1> K, View<float, 2> found) {
  const i64 height = depth.shape[0], width = depth.shape[1];
  const float tall = static_cast<float>(found.shape[0]), wide = static_cast<float>(found.shape[1]);
  const float fx = K(0), fy = K(1), cx = K(2), cy = K(3);
  for (i64 row = 0; row < height; row++)
    for (i64 column = 0; column < width; column++) {
      const float u = uvz(row, column, 0), v = uvz(row, column, 1), ahead = uvz(row, column, 2);
      if (!(ahead > 0 && -MOST_REACH < u && u < wide + MOST_REACH && -MOST_REACH < v && v < tall + MOST_REACH)) continue;
      const float near = 0.5f * depth(row, column) / ahead;
      const float x = (u - cx) / fx, y = (v - cy) / fy;
      const float half_u = fx * near * (std::abs(steps(0, 0) - x * steps(2, 0)) + std::abs(steps(0, 1) - x * steps(2, 1)));
      const float half_v = fy * near * (std::abs(steps(1, 0) - y * steps(2, 0)) + std::abs(steps(1, 1) - y * steps(2, 1)));
      float left = u - half_u, right = u + half_u, top = v - half_v, bottom = v + half_v;
      for (int k = 0; k < 2; k++) {
        const i64 r = row + k, c = column + 1 - k;
        if (r == height || c == width || uvz(r, c, 2) == 0) continue;
        if (std::abs(depth(r, c) - depth(row, column)) > SAME_SURFACE * depth(row, column)) continue;
        left = std::min(left, uvz(r, c, 0) + half_u), right = std::max(right, uvz(r, c, 0) - half_u);
        top = std::min(top, uvz(r, c, 1) + half_v), bottom = std::max(bottom, uvz(r, c, 1) - half_v);
      }
      const float first = std::max(0.0f, std::ceil(std::max(left, u - MOST_REACH)));
      const float last = std::min(wide, std::ceil(std::min(right, u + MOST_REACH)));
      const float begin = std::max(0.0f, std::ceil(std::max(top, v - MOST_REACH)));
      const float end = std::min(tall, std::ceil(std::min(bottom, v + MOST_REACH)));
      for (i64 i = static_cast<i64>(begin); i < static_cast<i64>(end); i++)
        for (i64 j = static_cast<i64>(first); j < static_cast<i64>(last); j++)
          if (ahead < found(i, j)) found(i, j) = ahead;
    }
}

inline PyMethodDef METHODS[] = {
    binding::method<project>("project", "Fill where each pixel is in the other picture, and its depth there."),
    binding::method<splat>("splat", "Lay each pixel over what it covers; the nearest wins."),
    {nullptr, nullptr, 0, nullptr},
};
}  // namespace objreg::registered_depth
