// SPDX-License-Identifier: Apache-2.0
// The kernels of view.py.
#pragma once
#include "objreg_ros/native/binding.hpp"

namespace objreg::view {
// The points (h, w, 3) of depth (h, w) with rays of the slopes x (w,) and y (h,); NaN outside z_min … z_max.
inline Array<float, 3> back_project(View<const float, 2> depth, View<const float, 1> x, View<const float, 1> y,
                                    float z_min, float z_max) {
  const i64 h = depth.shape[0], w = depth.shape[1];
  Array<float, 3> xyz(h, w, 3);
  const float *__restrict across = x.cut(0, w).data;
  for (i64 i = 0; i < h; i++) {
    const float *__restrict row = depth.row(i).data;
    float *__restrict out = xyz.row(i).data;
    const float down = y(i);
    for (i64 j = 0; j < w; j++) {
      const float z = (row[j] > z_min) & (row[j] < z_max) ? row[j] : std::numeric_limits<float>::quiet_NaN();
      out[3 * j] = across[j] * z, out[3 * j + 1] = down * z, out[3 * j + 2] = z;
    }
  }
  return xyz;
}

inline PyMethodDef METHODS[] = {
    binding::method<back_project>("back_project", "The points of a depth image."),
    {nullptr, nullptr, 0, nullptr},
};
}  // namespace objreg::view
