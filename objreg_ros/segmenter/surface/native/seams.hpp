// SPDX-License-Identifier: Apache-2.0
// The kernels of seams.py.
#pragma once
#include "objreg_ros/native/binding.hpp"
#include "objreg_ros/segmenter/surface/native/cells.hpp"

namespace objreg::seams {
using cells::REACH;
constexpr float STEP = 0.5f;  // of a depth jump: the bend of the depth that is a step

// Whether a surface over depth z is a valley, from a point of depth s with the normal n to one of depth t with the
// normal m; d_x and d_y are from the first to the second.
inline bool is_valley(float d_x, float d_y, float s, float t, float z, float n_x, float n_y, float n_z, float m_x,
                      float m_y, float m_z, float bend, float jump) {
  const float d_z = t - s, dot = d_x * (m_x - n_x) + d_y * (m_y - n_y) + d_z * (m_z - n_z);
  const bool one_surface = std::max(std::abs(s - z), std::abs(t - z)) < jump;
  const bool known = n_z * m_z != 0.0f;
  return one_surface & known & (-dot * std::abs(dot) > bend * (d_x * d_x + d_y * d_y + d_z * d_z));
}

inline bool is_bump(float before, float z, float after, float limit) {
  return (std::abs(before + after - z - z) > limit) & (before * after > 0.0f);
}

struct Row {  // of cells: the depth and the normals
  const float *z, *x, *y, *w;
};

inline Row row_of(View<const float, 2> depth, View<const float, 3> normals, i64 i) {
  return {depth.row(i).data, normals.row(0).row(i).data, normals.row(1).row(i).data, normals.row(2).row(i).data};
}

// Fill `found` (w,): whether a cell is a seam by what is left and right of it.
inline void find_along(Row row, const float *__restrict x, float y, i64 width, float bend, float a, float b,
                       i32 *__restrict found) {
  constexpr i64 R = REACH;
  const float *__restrict z = row.z, *__restrict n_x = row.x, *__restrict n_y = row.y, *__restrict n_z = row.w;
  for (i64 j = R; j < width - R; j++) {
    const float c = z[j], s = z[j - R], t = z[j + R], jump = a + b * c * c;
    const bool valley =
        is_valley(x[j + R] * t - x[j - R] * s, y * t - y * s, s, t, c, n_x[j - R], n_y[j - R], n_z[j - R], n_x[j + R],
                  n_y[j + R], n_z[j + R], bend * std::max(c * c, 1.0f), 2.0f * jump);
    found[j] = valley | is_bump(z[j - 1], c, z[j + 1], STEP * jump) ? 1 : 0;
  }
}

// Add to `found` whether a cell is a seam by what is above and below it; `far_up` and `far_down` are REACH rows away.
inline void find_across(Row far_up, const float *__restrict up, const float *__restrict here,
                        const float *__restrict down, Row far_down, const float *__restrict x, float y_up, float y_down,
                        i64 width, float bend, float a, float b, i32 *__restrict found) {
  const float *__restrict above = far_up.z, *__restrict below = far_down.z;
  const float *__restrict n_x = far_up.x, *__restrict n_y = far_up.y, *__restrict n_z = far_up.w;
  const float *__restrict m_x = far_down.x, *__restrict m_y = far_down.y, *__restrict m_z = far_down.w;
  for (i64 j = REACH; j < width - REACH; j++) {
    const float c = here[j], s = above[j], t = below[j], jump = a + b * c * c;
    const bool valley = is_valley(x[j] * t - x[j] * s, y_down * t - y_up * s, s, t, c, n_x[j], n_y[j], n_z[j], m_x[j],
                                  m_y[j], m_z[j], bend * std::max(c * c, 1.0f), 2.0f * jump);
    const i32 seam = valley | is_bump(up[j], c, down[j], STEP * jump) ? 1 : 0;
    found[j] = c > 0.0f ? found[j] | seam : 0;
  }
}

// Fill `seams`, which is false before: the cells in a valley or at a step; `bend` is of a valley at 1 m, `a` and `b` of
// a depth jump. Rows shifted against each other, so that the CPU's vectors see plain indices.
inline void find(View<const float, 2> depth, View<const float, 3> normals, View<const float, 1> x,
                 View<const float, 1> y, float bend, float a, float b, View<bool, 2> seams) {
  const i64 h = depth.shape[0], w = depth.shape[1];
  if (std::min(h, w) <= 2 * REACH) return;
  auto found = zeros<i32, 1>(w);
  for (i64 i = REACH; i < h - REACH; i++) {
    find_along(row_of(depth, normals, i), x.data, y(i), w, bend, a, b, found.data);
    find_across(row_of(depth, normals, i - REACH), depth.row(i - 1).data, depth.row(i).data, depth.row(i + 1).data,
                row_of(depth, normals, i + REACH), x.data, y(i - REACH), y(i + REACH), w, bend, a, b, found.data);
    const i32 *__restrict marks = found.data;
    bool *__restrict out = seams.row(i).data;
    for (i64 j = REACH; j < w - REACH; j++) out[j] = marks[j] != 0;
  }
}

inline PyMethodDef METHODS[] = {
    binding::method<find>("find", "Fill the cells in a valley or at a step."),
    {nullptr, nullptr, 0, nullptr},
};
}  // namespace objreg::seams
