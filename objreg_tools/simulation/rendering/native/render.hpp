// SPDX-License-Identifier: Apache-2.0
// The kernel of render.py.
#pragma once
#include "objreg_ros/native/binding.hpp"

namespace objreg::render {
// (count, 5): x0, y0, x1, y1 (outside) and the number of pixels of every instance.
inline Array<i64, 2> extents(View<const u16, 2> instance, i64 count) {
  auto out = zeros<i64, 2>(count, 5);
  for (i64 k = 0; k < count; k++) out(k, 0) = out(k, 1) = i64{1} << 31;
  for (i64 y = 0; y < instance.shape[0]; y++) {
    for (i64 x = 0; x < instance.shape[1]; x++) {
      const i64 k = instance(y, x);
      if (k == 0) continue;
      out(k, 0) = std::min(out(k, 0), x), out(k, 1) = std::min(out(k, 1), y);
      out(k, 2) = std::max(out(k, 2), x + 1), out(k, 3) = std::max(out(k, 3), y + 1);
      out(k, 4)++;
    }
  }
  return out;
}

inline PyMethodDef METHODS[] = {
    binding::method<extents>("extents", "(count, 5): x0, y0, x1, y1 and the number of pixels of every instance."),
    {nullptr, nullptr, 0, nullptr},
};
}  // namespace objreg::render
