// SPDX-License-Identifier: Apache-2.0
// The kernels of holes.py.
#pragma once
#include "objreg_ros/native/binding.hpp"

namespace objreg::holes {
constexpr i64 OPEN = i64{1} << 40;  // more pairs of cells than there are
constexpr double SMOOTH = 0.6;      // share of a hole's border without a depth jump

// Left, top, right and bottom of the chosen cells, half open; all 0 for none.
inline std::tuple<i64, i64, i64, i64> bounds(View<const bool, 2> chosen) {
  i64 left = chosen.shape[1], top = 0, right = 0, bottom = 0;
  for (i64 i = 0; i < chosen.shape[0]; i++) {
    const auto row = chosen.row(i);
    i64 first = 0, last = row.size();
    while (first < last && !row(first)) first++;
    if (first == last) continue;
    while (!row(last - 1)) last--;
    top = bottom == 0 ? i : top, bottom = i + 1;
    left = std::min(left, first), right = std::max(right, last);
  }
  if (bottom == 0) return {0, 0, 0, 0};
  return {left, top, right, bottom};
}

// Add to `chosen` those of the surfaces `labels` (h, w), 0 ... count, that it surrounds and that mostly go on without a
// depth jump; their first cell is at `left` and `top` of it.
inline void fill(View<bool, 2> chosen, i64 left, i64 top, View<const float, 2> depth, View<const i32, 2> labels,
                 i64 count, float a, float b) {
  const i64 h = labels.shape[0], w = labels.shape[1];
  auto pairs = zeros<i64, 1>(count + 1), smooth = zeros<i64, 1>(count + 1);
  for (i64 i = 0; i < h; i++) {
    for (i64 j = 0; j < w; j++) {
      const i32 k = labels(i, j);
      const float z = depth(i, j);
      if (k == 0 || z <= 0.0f) continue;
      if (i == 0 || j == 0 || i == h - 1 || j == w - 1) {
        pairs(k) = OPEN;
        continue;
      }
      const float limit = a + b * z * z;
      const auto look = [&](i64 p, i64 q) {
        if (!chosen(top + p, left + q)) return;
        pairs(k)++;
        smooth(k) += std::abs(depth(p, q) - z) < limit;
      };
      look(i - 1, j), look(i + 1, j), look(i, j - 1), look(i, j + 1);
    }
  }
  for (i64 i = 0; i < h; i++) {
    for (i64 j = 0; j < w; j++) {
      const i32 k = labels(i, j);
      const bool within = k > 0 && depth(i, j) > 0.0f && smooth(k) > 0 && smooth(k) >= SMOOTH * pairs(k);
      if (within) chosen(top + i, left + j) = true;
    }
  }
}

inline PyMethodDef METHODS[] = {
    binding::method<bounds>("bounds", "Left, top, right and bottom of the chosen cells."),
    binding::method<fill>("fill", "Add the surrounded surfaces to the chosen cells."),
    {nullptr, nullptr, 0, nullptr},
};
}  // namespace objreg::holes
