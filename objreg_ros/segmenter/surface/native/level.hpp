// SPDX-License-Identifier: Apache-2.0
// The kernels of level.py.
#pragma once
#include "objreg_ros/native/binding.hpp"

namespace objreg::level {
constexpr double OWN_TOP = 0.65;  // a level part with more of it in a box is a top of the object there
constexpr double LOWEST = 0.1;    // with less than this share of the cells in and around the box below it it is no top
constexpr i64 MIN_NEAR = 12;      // coarse cells of a part around a box that say something

using Window = std::array<i64, 4>;  // left, top, right, bottom in cells, half open
// Of a crop: depth (h, w), the slopes x (w,) and y (h,) of its rays, and its first pixel's column, row and step.
using Grid = std::tuple<View<const float, 2>, View<const float, 1>, View<const float, 1>, std::array<i64, 3>>;
using Tolerance = std::array<float, 2>;  // a plane's: m, and its growth with the square of the depth, 1/m

inline i64 ceil_div(i64 a, i64 b) { return -floor_div(-a, b); }

// (count,) how many cells each part has in a window of cells `stride` times as fine; none for 0.
inline Array<i64, 1> count_cells(View<const i32, 2> parts, Window window, i64 stride, i64 count) {
  auto near = zeros<i64, 1>(count);
  const i64 left = ceil_div(window[0], stride), right = std::min(ceil_div(window[2], stride), parts.shape[1]);
  const i64 top = ceil_div(window[1], stride), bottom = std::min(ceil_div(window[3], stride), parts.shape[0]);
  for (i64 i = top; i < bottom; i++) {
    const auto row = parts.row(i);
    for (i64 j = left; j < right; j++) near(row(j))++;
  }
  near(0) = 0;
  return near;
}

// Fill `marks` (w,): the columns that are marked in any of the rows first ... end.
inline void any_row(View<const bool, 2> mask, i64 first, i64 end, View<bool, 1> marks) {
  marks.fill(false);
  for (i64 i = first; i < end; i++) {
    const auto row = mask.row(i);
    for (i64 j = 0; j < row.size(); j++) marks(j) = marks(j) | row(j);
  }
}

// Fill `here`: the cells with depth no farther than `reach` coarse cells from a kept part, along both axes.
inline void spread(View<const i32, 2> parts, View<const bool, 1> kept, Window crop, i64 coarse_step, i64 reach,
                   const Grid &grid, View<bool, 2> here) {
  const auto &depth = std::get<0>(grid);
  const auto [first_u, first_v, step] = std::get<3>(grid);
  const i64 left = crop[0], top = crop[1];
  const i64 h = std::min(crop[3], parts.shape[0]) - top, w = std::min(crop[2], parts.shape[1]) - left;
  auto mask = zeros<bool, 2>(h, w);
  for (i64 i = 0; i < h; i++) {
    const auto row = parts.row(top + i).cut(left, left + w);
    const auto marks = mask.row(i);
    i64 free_from = 0;  // the first column that is not marked by what was met before
    for (i64 j = 0; j < w; j++) {
      if (!kept(row(j))) continue;
      const i64 end = std::min(w, j + reach + 1);
      for (i64 k = std::max(free_from, j - reach); k < end; k++) marks(k) = true;
      free_from = j + reach + 1;
    }
  }
  Array<i32, 1> columns(depth.shape[1]);
  for (i64 j = 0; j < columns.size(); j++)
    columns(j) = static_cast<i32>(std::min(floor_div(first_u + step * j, coarse_step) - left, w - 1));
  Array<bool, 1> marks(w);
  i64 now = -1;
  for (i64 i = 0; i < depth.shape[0]; i++) {
    const i64 middle = std::min(floor_div(first_v + i * step, coarse_step) - top, h - 1);
    if (middle != now) {
      any_row(mask, std::max<i64>(0, middle - reach), std::min(h, middle + reach + 1), marks);
      now = middle;
    }
    const auto row = depth.row(i);
    const auto out = here.row(i);
    for (i64 j = 0; j < row.size(); j++) out(j) = marks(columns(j)) & (row(j) > 0.0f);
  }
}

// The share of the cells that lie well below a plane; around a tight box there are some where in it are none.
inline double share_below(View<const float, 1> normal, float offset, Tolerance tolerance, const Grid &grid) {
  const auto &[depth, x, y, _] = grid;
  const float n_x = normal(0), n_z = normal(2);
  i64 known = 0, below = 0;
  for (i64 i = 0; i < depth.shape[0]; i++) {
    const float *__restrict row = depth.row(i).data, *__restrict slope = x.data;
    const float n_y = normal(1) * y(i);
    i32 seen = 0, lower = 0;
    for (i64 j = 0; j < depth.shape[1]; j++) {
      const float z = row[j];
      const float height = z * (n_x * slope[j] + n_y + n_z) + offset;
      seen += z > 0.0f;
      lower += (z > 0.0f) & (height < -(tolerance[0] + tolerance[1] * z * z));
    }
    known += seen, below += lower;
  }
  return static_cast<double>(below) / static_cast<double>(std::max<i64>(1, known));
}

// Fill `here`: where a support may be what the objects in `window` stand on; whether it is anywhere. A part that lies
// mostly in the window is a top of the object itself, unless more of its plane is seen around it, or nothing is seen
// below it. `reach` coarse cells a support surface is thought to go on.
inline bool find_beneath(View<const i32, 2> parts, View<const i64, 1> total, View<const float, 1> normal, float offset,
                         Tolerance tolerance, Window window, Grid grid, i64 coarse_step, i64 reach,
                         View<bool, 2> here) {
  const auto &depth = std::get<0>(grid);
  const auto [first_u, first_v, step] = std::get<3>(grid);
  const i64 h = depth.shape[0], w = depth.shape[1];
  const i64 left = floor_div(first_u, coarse_step), top = floor_div(first_v, coarse_step);
  const i64 stride = coarse_step / step;  // 1 or more
  const Window crop{left, top, left + ceil_div(w + stride, stride), top + ceil_div(h + stride, stride)};
  const i64 count = total.size();
  const auto near = count_cells(parts, crop, 1, count), within = count_cells(parts, window, stride, count);
  const auto is_inside = [&](i64 k) { return within(k) > OWN_TOP * total(k); };
  i64 around_it = 0, on_it = 0;
  for (i64 k = 1; k < count; k++) (is_inside(k) ? on_it : around_it) += near(k);
  if (around_it + on_it < MIN_NEAR) return false;
  const bool is_top = on_it > 0 && around_it <= on_it && share_below(normal, offset, tolerance, grid) > LOWEST;
  auto kept = zeros<bool, 1>(count);
  bool some = false;
  for (i64 k = 1; k < count; k++) {
    kept(k) = near(k) >= MIN_NEAR && !(is_top && is_inside(k));
    some |= kept(k);
  }
  if (some) spread(parts, kept, crop, coarse_step, reach, grid, here);
  return some;
}

// Fill `flat` (w,): 1 where a cell of a row is within base + limit · tolerance of the plane, else 0.
inline void find_flat(const float *__restrict depth, const float *__restrict x, i64 width, float n_x, float ahead,
                      float offset, float base, float limit, Tolerance tolerance, i32 *__restrict flat) {
  for (i64 j = 0; j < width; j++) {
    const float z = depth[j], height = z * (n_x * x[j] + ahead) + offset;
    flat[j] = std::abs(height) < base + limit * (tolerance[0] + tolerance[1] * z * z) ? 1 : 0;
  }
}

// Mark the cells of `here` within base + limit · tolerance of the plane.
inline void mark(View<const float, 2> depth, View<const float, 1> x, View<const float, 1> y, View<const bool, 2> here,
                 View<const float, 1> n, float offset, float base, float limit, Tolerance tolerance,
                 View<bool, 2> level) {
  const i64 w = depth.shape[1];
  Array<i32, 1> flat(w);
  for (i64 i = 0; i < depth.shape[0]; i++) {
    find_flat(depth.row(i).data, x.data, w, n(0), n(1) * y(i) + n(2), offset, base, limit, tolerance, flat.data);
    const auto *__restrict possible = reinterpret_cast<const u8 *>(here.row(i).data);
    const i32 *__restrict found = flat.data;
    auto *__restrict out = reinterpret_cast<u8 *>(level.row(i).data);  // 0 or 1: bits of bytes are quicker than bools
    for (i64 j = 0; j < w; j++) out[j] = static_cast<u8>(out[j] | (possible[j] & found[j]));
  }
}

inline PyMethodDef METHODS[] = {
    binding::method<find_beneath>("find_beneath", "Fill where a support is; whether it is anywhere."),
    binding::method<mark>("mark", "Mark the cells of a plane."),
    {nullptr, nullptr, 0, nullptr},
};
}  // namespace objreg::level
