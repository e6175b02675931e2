// SPDX-License-Identifier: Apache-2.0
// The kernels of extract.py.
#pragma once
#include "objreg_ros/native/binding.hpp"

namespace objreg::extract {
constexpr float FAR_M = 65.0f;          // the step of depth that is no edge grows beyond all there
constexpr float UNKNOWN_COSINE = 0.7f;  // of a surface whose normal is not known
constexpr u8 MIN_NEIGHBOURS = 2;        // of 8; a pixel with fewer in its object is an outlier

using Jump = std::array<float, 2>;
struct Grid {
  View<const float, 2> depth;
  View<const float, 3> normals;
  View<const bool, 2> chosen;
  i64 left, top, step;
};

inline float largest_step(const Jump &jump, float z) { return jump[0] + jump[1] * z * z; }

// Of each column of pixels the column of its cells, and the slope of its ray.
inline std::tuple<Array<i32, 1>, Array<float, 1>> columns(i64 x0, i64 x1, const Grid &grid, double fx, double cx) {
  Array<i32, 1> cols(x1 - x0);
  Array<float, 1> x(x1 - x0);
  for (i64 u = x0; u < x1; u++) {
    cols(u - x0) = static_cast<i32>(std::min(floor_div(u - grid.left, grid.step), grid.depth.shape[1] - 1));
    x(u - x0) = static_cast<float>((u - cx) / fx);
  }
  return {std::move(cols), std::move(x)};
}

// The row of the cells of a row of pixels.
inline i64 row_of(i64 v, const Grid &grid) {
  return std::min(floor_div(v - grid.top, grid.step), grid.depth.shape[0] - 1);
}

// Fill what a row of pixels needs of its row of cells; whether any pixel can belong to a chosen one.
inline bool unfold(View<const float, 1> cells, View<const bool, 1> chosen, View<const bool, 1> near,
                   View<const i32, 1> cols, View<float, 1> cell, View<u8, 1> own, View<u8, 1> possible) {
  bool some = false;
  for (i64 u = 0; u < cols.size(); u++) {
    const i64 j = cols(u);
    cell(u) = cells(j), own(u) = chosen(j), possible(u) = near(j);
    some |= near(j);
  }
  return some;
}

// (h, w) bool: the cells that are chosen or have a chosen one beside them, across corners too.
inline Array<bool, 2> spread(View<const bool, 2> chosen) {
  const i64 h = chosen.shape[0], w = chosen.shape[1];
  Array<bool, 2> out(h, w);
  auto column = zeros<bool, 1>(w + 2);
  for (i64 i = 0; i < h; i++) {
    const bool *above = chosen.row(std::max<i64>(i - 1, 0)).data, *here = chosen.row(i).data;
    const bool *below = chosen.row(std::min(i + 1, h - 1)).data;
    bool *__restrict middle = column.from(1).data;
    for (i64 j = 0; j < w; j++) middle[j] = above[j] | here[j] | below[j];
    const bool *left = column.data;
    bool *__restrict row = out.row(i).data;
    for (i64 j = 0; j < w; j++) row[j] = left[j] | left[j + 1] | left[j + 2];
  }
  return out;
}

// Whether the cell nearest in depth to z around (i, j) is chosen; false for none within `limit`.
inline bool nearest(const Grid &grid, i64 i, i64 j, float z, float limit) {
  bool found = false;
  for (i64 p = std::max<i64>(0, i - 1); p < std::min(grid.depth.shape[0], i + 2); p++)
    for (i64 q = std::max<i64>(0, j - 1); q < std::min(grid.depth.shape[1], j + 2); q++) {
      const float off = std::abs(grid.depth(p, q) - z);
      if (grid.depth(p, q) > 0 && off < limit) limit = off, found = grid.chosen(p, q);
    }
  return found;
}

// Mark the pixels of a row whose own cell is a chosen one; how many, and how many are open to the cells around.
inline std::array<i32, 2> mark_own(i64 n, const float *__restrict row, const float *__restrict cell,
                                   const u8 *__restrict own, const u8 *__restrict possible, const Jump &jump,
                                   u8 *__restrict marks, u8 *__restrict open_ends) {
  const float a = jump[0], b = jump[1];
  i32 found = 0, doubtful = 0;
  for (i64 u = 0; u < n; u++) {
    const float z = row[u];
    const bool known = (z > 0) & (z < FAR_M);
    const bool agrees = (std::abs(cell[u] - z) < a + b * z * z) & (cell[u] > 0) & known;
    const u8 own_here = own[u], possible_here = possible[u];  // no branches around what is read: for the vectors
    const u8 mark = agrees ? own_here : u8{0}, open = known & !agrees ? possible_here : u8{0};
    marks[u] = mark, open_ends[u] = open;
    found += mark, doubtful += open;
  }
  return {found, doubtful};
}

// Mark the pixels that belong to chosen cells, by their own cell or by the nearest in depth around it; count them. A
// row's cells are spread over its pixels first, so that the CPU's vectors decide about all but a few.
inline i64 mark(View<const float, 2> depth, std::array<i64, 4> box, const Grid &grid, View<const i32, 1> cols,
                const Jump &jump, View<u8, 2> mask) {
  const auto [x0, y0, x1, y1] = box;
  const i64 n = x1 - x0;
  i64 now = -1, count = 0;
  const auto near = spread(grid.chosen);
  Array<float, 1> cell(n);
  Array<u8, 1> own(n), possible(n), open_ends(n);
  bool some = false;
  for (i64 v = y0; v < y1; v++) {
    const i64 i = row_of(v, grid);
    if (i != now) {
      some = unfold(grid.depth.row(i), grid.chosen.row(i), near.row(i), cols, cell, own, possible);
      now = i;
    }
    if (!some) continue;
    const auto row = depth.row(v).cut(x0, x1);
    const auto marks = mask.row(v - y0 + 1).cut(1, n + 1);
    auto [found, doubtful] =
        mark_own(n, row.data, cell.data, own.data, possible.data, jump, marks.data, open_ends.data);
    for (i64 u = 0; doubtful > 0 && u < n; u++)
      if (open_ends(u)) {
        marks(u) = nearest(grid, i, cols(u), row(u), largest_step(jump, row(u)));
        found += marks(u), doubtful--;
      }
    count += found;
  }
  return count;
}

// Fill `kept` (w,): the marked pixels of a row but for outliers; the first of them and the one after the last. The rows
// of the mask have a rim of one.
inline std::array<i64, 2> keep(const u8 *__restrict above, const u8 *__restrict here, const u8 *__restrict below,
                               View<u8, 1> kept) {
  u8 *__restrict out = kept.data;
  for (i64 u = 0; u < kept.size(); u++) {
    const u8 beside = here[u] + here[u + 2] + above[u + 1] + below[u + 1];
    const u8 across = above[u] + above[u + 2] + below[u] + below[u + 2];
    const u8 around = beside + across;
    const u8 marked = here[u + 1];
    out[u] = around >= MIN_NEIGHBOURS ? marked : u8{0};
  }
  i64 first = 0, end = kept.size();
  while (first < end && !kept(first)) first++;
  while (end > first && !kept(end - 1)) end--;
  return {first, end};
}

// Fill `flags` (x1 - x0,): `edge` where two rows or columns away is no depth or a depth beyond a jump, else 0. `wide`
// has room for the row with two more pixels at each side, the image's last ones repeated.
inline void flag_jumps(View<const float, 2> depth, i64 v, i64 x0, i64 x1, const Jump &jump, u16 edge,
                       View<float, 1> wide, u16 *__restrict flags) {
  const i64 h = depth.shape[0], w = depth.shape[1], n = x1 - x0;
  const float *__restrict up = depth.row(std::max<i64>(v - 2, 0)).cut(x0, x1).data;
  const float *__restrict here = depth.row(v).cut(x0, x1).data;
  const float *__restrict down = depth.row(std::min(v + 2, h - 1)).cut(x0, x1).data;
  for (i64 k = 0; k < 2; k++) {
    wide(k) = depth(v, std::max<i64>(x0 + k - 2, 0));
    wide(n + 2 + k) = depth(v, std::min(x1 + k, w - 1));
  }
  std::copy_n(here, n, wide.cut(2, n + 2).data);
  const float *__restrict left = wide.data;
  const float *__restrict right = wide.cut(4, n + 4).data;
  const float a = jump[0], b = jump[1];
  for (i64 u = 0; u < n; u++) {
    const float z = here[u];
    const float across = std::max(std::max(std::abs(left[u] - z), std::abs(right[u] - z)),
                                  std::max(std::abs(up[u] - z), std::abs(down[u] - z)));
    flags[u] = !(across < 2 * (a + b * z * z)) ? edge : u16{0};
  }
}

// Fill the points and normals of pixels of a row that lie side by side; their area times fx fy.
inline float fill(View<const float, 1> x, float y, View<const float, 1> z, View<const float, 2> cell_normals,
                  View<const i32, 1> cols, float min_cosine, View<float, 2> xyz, View<float, 2> normals) {
  const i64 n = z.size();
  const float *__restrict n_x = cell_normals.row(0).data;
  const float *__restrict n_y = cell_normals.row(1).data;
  const float *__restrict n_z = cell_normals.row(2).data;
  const float *__restrict slope = x.cut(0, n).data;
  const i32 *__restrict cell = cols.cut(0, n).data;
  const float *__restrict ahead = z.data;
  float *__restrict point = xyz.cut(0, n).data;
  float *__restrict normal = normals.cut(0, n).data;
  float area = 0;
  for (i64 k = 0; k < n; k++) {
    check(cell[k], cell_normals.shape[1]);
    const float a = n_x[cell[k]], b = n_y[cell[k]], c = n_z[cell[k]];
    point[3 * k] = slope[k] * ahead[k], point[3 * k + 1] = y * ahead[k], point[3 * k + 2] = ahead[k];
    normal[3 * k] = a, normal[3 * k + 1] = b, normal[3 * k + 2] = c;
    const float cosine = std::abs(slope[k] * a + y * b + c);
    area += ahead[k] * ahead[k] / (cosine > 0 ? std::max(cosine, min_cosine) : UNKNOWN_COSINE);
  }
  return area;
}

inline void copy(View<const u8, 2> pixels, View<u8, 2> out) {
  if (pixels.stride[0] == 3) std::copy_n(pixels.data, 3 * pixels.size(), out.cut(0, pixels.size()).data);
  else
    for (i64 k = 0; k < pixels.size(); k++)
      for (int c = 0; c < 3; c++) out(k, c) = pixels(k, c);
}

using Around = std::tuple<i64, i64, i64, i64>;
using Points = std::tuple<Array<float, 2>, Array<float, 2>, Array<u8, 2>>;

// The fields of `Pixels`, the area times fx fy; row by row, and in each row run by run of pixels that are kept. `grid`
// is depth, normals, chosen, and left, top and step; `pinhole` fx, fy, cx, cy; `edge` the flag of an edge.
inline std::tuple<Array<float, 2>, Array<float, 2>, Array<u8, 2>, Array<u16, 1>, double, Around> extract(
    View<const float, 2> depth, View<const u8, 3> rgb, std::array<i64, 4> box,
    std::tuple<View<const float, 2>, View<const float, 3>, View<const bool, 2>, std::array<i64, 3>> cells,
    std::array<double, 4> pinhole, Jump jump, i64 edge_flag, float min_cosine) {
  const auto &place = std::get<3>(cells);
  const Grid grid{std::get<0>(cells), std::get<1>(cells), std::get<2>(cells), place[0], place[1], place[2]};
  const auto [x0, y0, x1, y1] = box;
  const auto [fx, fy, cx, cy] = pinhole;
  const auto [cols, x] = columns(x0, x1, grid, fx, cx);
  auto mask = zeros<u8, 2>(y1 - y0 + 2, x1 - x0 + 2);  // with a rim, so that every pixel has eight neighbours
  const i64 count = mark(depth, box, grid, cols, jump, mask);
  Array<float, 2> xyz(count, 3), normals(count, 3);
  Array<u8, 2> colour(rgb.size() > 0 ? count : 0, 3);
  Array<u16, 1> edge(count), flags(x1 - x0);
  Array<u8, 1> kept(x1 - x0);
  Array<float, 1> wide(x1 - x0 + 4);
  i64 n = 0;
  double area = 0.0;
  std::array<i64, 4> around{x1, y1, x0, y0};
  for (i64 v = y0; v < y1; v++) {
    auto [left, right] = keep(mask.row(v - y0).data, mask.row(v - y0 + 1).data, mask.row(v - y0 + 2).data, kept);
    if (left == right) continue;
    around = {std::min(around[0], x0 + left), std::min(around[1], v), std::max(around[2], x0 + right), v + 1};
    flag_jumps(depth, v, x0 + left, x0 + right, jump, static_cast<u16>(edge_flag), wide, flags.from(left).data);
    const float y = static_cast<float>((v - cy) / fy);
    const i64 i = row_of(v, grid);
    check(i, grid.normals.shape[1]);
    const View<const float, 2> cell_normals{grid.normals.data + i * grid.normals.stride[1],
                                            {grid.normals.shape[0], grid.normals.shape[2]},
                                            {grid.normals.stride[0], 1}};
    while (left < right) {
      i64 last = left;
      while (last < right && kept(last)) last++;
      const i64 size = last - left;
      const auto z = depth.row(v).cut(x0 + left, x0 + last);
      area += fill(x.from(left), y, z, cell_normals, cols.from(left), min_cosine, xyz.from(n), normals.from(n));
      std::copy_n(flags.cut(left, last).data, size, edge.cut(n, n + size).data);
      if (rgb.size() > 0) copy(rgb.row(v).cut(x0 + left, x0 + last), colour.from(n));
      n += size, left = last;
      while (left < right && !kept(left)) left++;
    }
  }
  const i64 coloured = rgb.size() > 0 ? n : 0;
  return {std::move(xyz).first(n), std::move(normals).first(n), std::move(colour).first(coloured),
          std::move(edge).first(n), area, Around{around[0], around[1], around[2], around[3]}};
}

// Points, normals and colours of `cells`, (h, w) bool of a whole frame with `step` pixels a cell.
inline Points gather_cells(View<const float, 2> depth, View<const float, 3> cell_normals, View<const float, 1> x,
                           View<const float, 1> y, i64 step, View<const u8, 3> rgb, View<const bool, 2> cells) {
  const i64 h = depth.shape[0], w = depth.shape[1];
  i64 count = 0, n = 0;
  for (i64 i = 0; i < h; i++) {
    const auto row = cells.row(i);
    for (i64 j = 0; j < row.size(); j++) count += row(j);
  }
  Array<float, 2> xyz(count, 3), normals(count, 3);
  Array<u8, 2> colour(rgb.size() > 0 ? count : 0, 3);
  for (i64 i = 0; i < h; i++)
    for (i64 j = 0; j < w; j++) {
      if (!cells(i, j)) continue;
      const float z = depth(i, j);
      xyz(n, 0) = x(j) * z, xyz(n, 1) = y(i) * z, xyz(n, 2) = z;
      for (int k = 0; k < 3; k++) normals(n, k) = cell_normals(k, i, j);
      for (int k = 0; rgb.size() > 0 && k < 3; k++) colour(n, k) = rgb(i * step, j * step, k);
      n++;
    }
  return {std::move(xyz), std::move(normals), std::move(colour)};
}

inline PyMethodDef METHODS[] = {
    binding::method<extract>("extract", "The pixels of chosen cells: points, normals, colours, edges, area, bounds."),
    binding::method<gather_cells>("gather_cells", "Points, normals and colours of cells of a whole frame."),
    {nullptr, nullptr, 0, nullptr},
};
}  // namespace objreg::extract
