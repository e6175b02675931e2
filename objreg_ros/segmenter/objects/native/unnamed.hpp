// SPDX-License-Identifier: Apache-2.0
// The kernels of unnamed.py.
#pragma once
#include "objreg_ros/native/binding.hpp"

namespace objreg::unnamed {
constexpr i64 REACH = 3;        // cells that a support is thought to go on, and within which a border looks beyond
constexpr float NEAR = 1.5f;    // tolerances of a plane within which a cell is of it
constexpr float TOP_M2 = 0.1f;  // a level part of less may be the top of an object

// The columns of the sums, as unnamed.py has them.
enum Sum { CELLS, DEPTH, TAKEN, SHOWN, HIDDEN, GOES_ON, OUTSIDE, STANDS, UNKNOWN, HEIGHT, BASE, BASES };

// The m² of each part of a plane.
inline Array<float, 1> areas_of(View<const float, 2> depth, View<const float, 1> x, View<const float, 1> y,
                                View<const i32, 2> parts, i64 count, View<const float, 1> n, float min_cosine) {
  auto areas = zeros<float, 1>(count);
  const float pixel = std::min(x.size(), y.size()) > 1 ? (x(1) - x(0)) * (y(1) - y(0)) : 1.0f;
  for (i64 i = 0; i < depth.shape[0]; i++)
    for (i64 j = 0; j < depth.shape[1]; j++)
      if (parts(i, j) > 0) {
        const float z = depth(i, j);
        areas(parts(i, j)) += z * z * pixel / std::max(std::abs(n(0) * x(j) + n(1) * y(i) + n(2)), min_cosine);
      }
  return areas;
}

// Mark the cells on a plane that are no farther than REACH cells from its large parts, along both axes. `tolerance` of
// a plane: m, and its growth.
inline void mark_level(View<const float, 2> depth, View<const float, 1> x, View<const float, 1> y,
                       View<const i32, 2> parts, i64 count, View<const float, 1> n, float offset,
                       std::array<float, 2> tolerance, float min_cosine, View<bool, 2> level) {
  const i64 h = depth.shape[0], w = depth.shape[1];
  const auto areas = areas_of(depth, x, y, parts, count, n, min_cosine);
  auto wide = zeros<bool, 2>(h, w);
  for (i64 i = 0; i < h; i++)
    for (i64 j = 0, free = 0; j < w; j++)
      if (areas(parts(i, j)) >= TOP_M2) {
        for (i64 k = std::max(free, j - REACH); k < std::min(w, j + REACH + 1); k++) wide(i, k) = true;
        free = j + REACH + 1;
      }
  Array<bool, 1> near(w);
  const float *__restrict slope = x.cut(0, w).data;
  bool *__restrict reached = near.data;
  const float a = n(0);
  for (i64 i = 0; i < h; i++) {
    near.fill(false);
    for (i64 p = std::max<i64>(0, i - REACH); p < std::min(h, i + REACH + 1); p++) {
      const bool *__restrict row = wide.row(p).data;
      for (i64 j = 0; j < w; j++) reached[j] |= row[j];
    }
    const float *__restrict cells = depth.row(i).data;
    bool *__restrict out = level.row(i).data;
    const float down = n(1) * y(i) + n(2);
    for (i64 j = 0; j < w; j++) {
      const float z = cells[j], off = std::abs(z * (a * slope[j] + down) + offset);
      out[j] |= reached[j] & (z > 0) & (off < NEAR * (tolerance[0] + tolerance[1] * z * z));
    }
  }
}

// What the looks beyond a border need of the whole grid.
struct Grid {
  View<const i32, 2> labels;
  View<const bool, 2> level;
  View<const float, 2> depth;
  View<const float, 1> x, y, up;
};

// Count what lies beyond the border of part k at cell (i, j), of depth z and a `height`, in one direction.
inline void look(const Grid &grid, i64 i, i64 j, i64 down, i64 right, i32 k, float z, float height, float jump,
                 View<double, 1> row) {
  i64 p = i, q = j;
  for (i64 step = 0; step < REACH; step++) {
    p += down, q += right;
    if (p < 0 || q < 0 || p >= grid.depth.shape[0] || q >= grid.depth.shape[1]) {
      row(step < 2 ? OUTSIDE : UNKNOWN) += 1;
      return;
    }
    const float other = grid.depth(p, q);
    if (other <= 0) continue;
    if (grid.labels(p, q) == k) {  // beyond a hole
      row(UNKNOWN) += 1;
      return;
    }
    if (other - z >= jump) {
      row(SHOWN) += 1;
      return;
    }
    if (z - other >= jump) {
      row(HIDDEN) += 1;
      return;
    }
    const float beyond = other * (grid.up(0) * grid.x(q) + grid.up(1) * grid.y(p) + grid.up(2));
    if (grid.level(p, q) && height > beyond - 0.5f * jump) {
      row(STANDS) += 1;
      row(BASE) += beyond;
      row(BASES) += 1;
    } else {
      row(GOES_ON) += 1;
    }
    return;
  }
  row(UNKNOWN) += 1;
}

// Fill of each part its `sums`, its `extent` in cells and the `reach` of its depth in m.
inline void survey(View<const i32, 2> labels, View<const bool, 2> level, View<const bool, 2> taken,
                   View<const float, 2> depth, View<const float, 1> x, View<const float, 1> y, View<const float, 1> up,
                   std::array<float, 2> bounds, View<double, 2> sums, View<i64, 2> extent, View<double, 2> reach) {
  const i64 h = labels.shape[0], w = labels.shape[1];
  const Grid grid{labels, level, depth, x, y, up};
  for (i64 i = 0; i < h; i++)
    for (i64 j = 0; j < w; j++) {
      const i32 k = labels(i, j);
      if (k == 0) continue;
      const float z = depth(i, j);
      const auto row = sums.row(k);
      if (row(CELLS) == 0) {
        extent(k, 0) = j, extent(k, 1) = i, extent(k, 2) = j + 1, extent(k, 3) = i + 1;
        reach(k, 0) = z, reach(k, 1) = z;
      }
      extent(k, 0) = std::min(extent(k, 0), j), extent(k, 2) = std::max(extent(k, 2), j + 1);
      extent(k, 3) = i + 1;
      reach(k, 0) = std::min<double>(reach(k, 0), z), reach(k, 1) = std::max<double>(reach(k, 1), z);
      row(CELLS) += 1;
      row(DEPTH) += z;
      row(TAKEN) += taken(i, j);
      const float height = z * (up(0) * x(j) + up(1) * y(i) + up(2));
      row(HEIGHT) += height;
      const float jump = bounds[0] + bounds[1] * z * z;
      if (j == 0 || labels(i, j - 1) != k) look(grid, i, j, 0, -1, k, z, height, jump, row);
      if (j == w - 1 || labels(i, j + 1) != k) look(grid, i, j, 0, 1, k, z, height, jump, row);
      if (i == 0 || labels(i - 1, j) != k) look(grid, i, j, -1, 0, k, z, height, jump, row);
      if (i == h - 1 || labels(i + 1, j) != k) look(grid, i, j, 1, 0, k, z, height, jump, row);
    }
}

inline PyMethodDef METHODS[] = {
    binding::method<mark_level>("mark_level", "Mark the cells on a plane that are near its large parts."),
    binding::method<survey>("survey", "Fill of each part its sums, its extent and the reach of its depth."),
    {nullptr, nullptr, 0, nullptr},
};
}  // namespace objreg::unnamed
