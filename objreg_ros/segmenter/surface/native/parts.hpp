// SPDX-License-Identifier: Apache-2.0
// The kernels of parts.py.
#pragma once
#include "objreg_ros/native/binding.hpp"

namespace objreg::parts {
constexpr i64 ACROSS = 3;       // cells over which two parts are neighbours
constexpr double ALIKE = 0.12;  // how far apart the shares of red, green and blue of one colour are
constexpr double DARK = 8.0;    // grey values that are added to each colour: what is nearly black has none

using Window = std::array<i64, 4>;  // left, top, right, bottom in cells, half open

struct Tables {  // of pairs of parts, each (1 + K, 1 + K): row and column 0 are of what is no part
  Array<i64, 2> touching, front;
  Array<float, 2> gap;
};

// (count + 1,) the place of each label in the order of their cells in the window, 0 without any; the last place.
inline std::tuple<Array<i32, 1>, i64> rank(View<const i32, 2> labels, i64 count, Window window, i64 limit) {
  const auto [left, top, right, bottom] = window;
  auto inside = zeros<i64, 1>(count + 1);
  auto number = zeros<i32, 1>(count + 1);
  for (i64 i = top; i < bottom; i++) {
    const auto row = labels.row(i);
    for (i64 j = left; j < right; j++) inside(row(j))++;
  }
  inside(0) = 0;
  for (i64 place = 1; place <= limit; place++) {
    i64 most = 0;
    for (i64 k = 1; k <= count; k++)
      if (number(k) == 0 && inside(k) > inside(most)) most = k;
    if (most == 0) return {std::move(number), place - 1};
    number(most) = static_cast<i32>(place);
  }
  return {std::move(number), limit};
}

// Add the cells first ... last of row i that lie in the window to `sums`.
inline void weigh(i64 i, i64 first, i64 last, Window window, float rim, View<double, 1> sums) {
  const auto [left, top, right, bottom] = window;
  if (!(top <= i && i < bottom)) return;
  first = std::max(first, left), last = std::min(last, right);
  const float off_v = float(std::abs(2 * i + 1 - top - bottom)) / float(bottom - top);
  const float scale = 1.0f / float(right - left);
  const i32 middle = static_cast<i32>(left + right - 1), end = static_cast<i32>(last);
  float weight = 0.0f;
  for (i32 j = static_cast<i32>(first); j < end; j++)
    weight += 1.0f - rim * std::max(float(std::abs(2 * j - middle)) * scale, off_v);
  sums(1) += static_cast<double>(std::max<i64>(0, last - first));
  sums(2) += weight;
}

inline void add_colours(View<const u8, 2> row, i64 first_u, i64 step, i64 first, i64 last, View<double, 1> sums) {
  i64 red = 0, green = 0, blue = 0;
  for (i64 j = first; j < last; j++) {
    const auto pixel = row.row(first_u + j * step);
    red += pixel(0), green += pixel(1), blue += pixel(2);
  }
  sums(4) += static_cast<double>(red), sums(5) += static_cast<double>(green), sums(6) += static_cast<double>(blue);
}

// Fill `renamed` and of each part its `extent` and the sums of its cells: all, those in the window, weighed by their
// place there, depth, red, green and blue; run by run, a run being the cells of one part in a row.
inline void sum_up(View<const i32, 2> labels, View<const i32, 1> number, Window window, View<const float, 2> depth,
                   std::array<i64, 3> pixels, View<const u8, 3> rgb, float rim, View<i32, 2> renamed,
                   View<double, 2> sums, View<i64, 2> extent) {
  const auto [first_u, first_v, step] = pixels;
  const i64 w = labels.shape[1];
  for (i64 i = 0; i < labels.shape[0]; i++) {
    const auto row = labels.row(i);
    const auto out = renamed.row(i);
    const auto z = depth.row(i);
    i64 last = 0;
    while (last < w) {
      const i64 first = last;
      const i32 label = row(last);
      while (last < w && row(last) == label) last++;
      const i32 k = number(label);
      float total = 0.0f;
      for (i64 j = first; j < last; j++) out(j) = k;
      if (k == 0) continue;
      for (i64 j = first; j < last; j++) total += z(j);
      if (sums(k, 0) == 0.0) extent(k, 0) = first, extent(k, 1) = i, extent(k, 2) = last;
      extent(k, 0) = std::min(extent(k, 0), first), extent(k, 2) = std::max(extent(k, 2), last);
      extent(k, 3) = i + 1;
      sums(k, 0) += static_cast<double>(last - first);
      sums(k, 3) += total;
      weigh(i, first, last, window, rim, sums.row(k));
      if (rgb.size() > 0) add_colours(rgb.row(first_v + i * step), first_u, step, first, last, sums.row(k));
    }
  }
}

// Set `bit` in `out` where a cell is of another part than its neighbour, of `other` and `far`, and both have depth.
inline void find_in_row(const i32 *__restrict here, const float *__restrict z, const i32 *__restrict other,
                        const float *__restrict far, i64 width, i32 least, i32 bit, i32 *__restrict out) {
  for (i64 j = 0; j < width; j++) {
    const bool known = (z[j] > 0.0f) & (far[j] > 0.0f) & (here[j] >= least) & (other[j] >= least);
    out[j] |= (here[j] != other[j]) & known ? bit : 0;
  }
}

// Fill the bits (w,) of row i: two for each distance d, whether a cell d to the right, or below, is of another part.
// Cells without depth are of no pair, nor are those of no part where the other one is farther than two cells.
inline void find_pairs(View<const i32, 2> labels, View<const float, 2> depth, i64 i, View<i32, 1> bits) {
  const auto here = labels.row(i);
  const auto z = depth.row(i);
  const i64 h = labels.shape[0], w = labels.shape[1];
  bits.fill(0);
  for (i64 d = 1; d <= ACROSS; d++) {
    const i32 right = 1 << (2 * d - 2), least = d <= 2 ? 0 : 1;
    if (d < w) find_in_row(here.data, z.data, here.from(d).data, z.from(d).data, w - d, least, right, bits.data);
    if (i + d < h)
      find_in_row(here.data, z.data, labels.row(i + d).data, depth.row(i + d).data, w, least, 2 * right, bits.data);
  }
}

// Count one pair of cells of two parts, `d` cells from each other.
inline void count_pair(View<const i32, 2> labels, View<const float, 2> depth, View<const float, 1> x,
                       View<const float, 1> y, i64 i, i64 j, i64 p, i64 q, i64 d, float jump, const Tables &tables) {
  const auto &[touching, front, gap] = tables;
  const i32 k = labels(i, j), o = labels(p, q);
  const float s = depth(i, j), t = depth(p, q);
  if (k > 0 && o > 0) {
    const float d_x = x(q) * t - x(j) * s, d_y = y(p) * t - y(i) * s, d_z = t - s;
    gap(k, o) = std::min(gap(k, o), d_x * d_x + d_y * d_y + d_z * d_z);
    gap(o, k) = gap(k, o);
  }
  if (d == 1 && std::abs(t - s) < jump) {
    touching(k, o)++;
    touching(o, k)++;
  } else if (d <= 2 && t - s >= jump) {
    front(k, o)++;
  } else if (d <= 2 && s - t >= jump) {
    front(o, k)++;
  }
}

// The tables of pairs of `count` parts, from the cells next to each other.
inline Tables compare(View<const i32, 2> labels, View<const float, 2> depth, View<const float, 1> x,
                      View<const float, 1> y, std::array<float, 2> bounds, i64 count) {
  const i64 k = count + 1;
  Tables tables{zeros<i64, 2>(k, k), zeros<i64, 2>(k, k),
                full<float, 2>(std::numeric_limits<float>::infinity(), k, k)};
  Array<i32, 1> pairs(labels.shape[1]);
  for (i64 i = 0; i < labels.shape[0]; i++) {
    find_pairs(labels, depth, i, pairs);
    const auto row = depth.row(i);
    for (i64 j = 0; j < row.size(); j++) {
      i32 bits = pairs(j);
      if (bits == 0) continue;
      const float jump = bounds[0] + bounds[1] * row(j) * row(j);
      for (i64 d = 1; d <= ACROSS; d++, bits >>= 2) {
        if (bits & 1) count_pair(labels, depth, x, y, i, j, i, j + d, d, jump, tables);
        if (bits & 2) count_pair(labels, depth, x, y, i, j, i + d, j, d, jump, tables);
      }
    }
  }
  return tables;
}

// (K, K): whether the shares of red, green and blue of two parts are about the same.
inline Array<bool, 2> find_alike(View<const double, 2> sums, bool coloured) {
  const i64 count = sums.size() - 1;
  Array<double, 2> share(count, 3);
  Array<bool, 2> alike(count, count);
  for (i64 k = 0; k < count; k++) {
    const double dark = DARK * sums(k + 1, 0);
    const double whole = sums(k + 1, 4) + sums(k + 1, 5) + sums(k + 1, 6) + 3.0 * dark;
    for (i64 c = 0; c < 3; c++) share(k, c) = (sums(k + 1, 4 + c) + dark) / whole;
  }
  for (i64 k = 0; k < count; k++) {
    for (i64 o = 0; o < count; o++) {
      const double off = std::abs(share(k, 0) - share(o, 0)) + std::abs(share(k, 1) - share(o, 1)) +
                         std::abs(share(k, 2) - share(o, 2));
      alike(k, o) = coloured && off < ALIKE;
    }
  }
  return alike;
}

using Column = Array<double, 1>;

// The fields of Parts, but for the rows 0 of extent, touching, gap and front, which are of what is no part. `rim` is
// how much less a cell at the rim of the box counts than one in its middle.
inline std::tuple<Array<i32, 2>, Column, Column, Array<i64, 2>, Column, Column, Column, Array<bool, 2>, Array<i64, 2>,
                  Array<float, 2>, Array<i64, 2>>
measure(View<const i32, 2> labels, i64 label_count, Window window, View<const float, 2> depth, View<const float, 1> x,
        View<const float, 1> y, std::array<i64, 3> pixels, View<const u8, 3> rgb, std::array<float, 2> bounds,
        float rim, i64 limit) {
  const auto [number, count] = rank(labels, label_count, window, limit);
  Array<i32, 2> renamed(labels.shape[0], labels.shape[1]);
  auto sums = zeros<double, 2>(count + 1, 7);
  auto extent = zeros<i64, 2>(count + 1, 4);
  sum_up(labels, number, window, depth, pixels, rgb, rim, renamed, sums, extent);
  auto [touching, front, gap] = compare(renamed, depth, x, y, bounds, count);
  const double wide = x.size() > 1 ? x(1) - x(0) : 0.0f, high = y.size() > 1 ? y(1) - y(0) : 0.0f;
  const double longer = std::max((window[2] - window[0]) * wide, (window[3] - window[1]) * high);
  Column total(count), weight(count), size(count), pure(count), figure(count);
  for (i64 p = 0; p < count; p++) {
    const i64 k = p + 1;
    total(p) = sums(k, 0), weight(p) = sums(k, 2);
    size(p) = longer * sums(k, 3) / sums(k, 0), pure(p) = sums(k, 1) / sums(k, 0);
    i64 shown = 0, hidden = 0;
    for (i64 o = 0; o <= count; o++) {
      shown += front(k, o);
      hidden += o > 0 ? front(o, k) : 0;
    }
    figure(p) = static_cast<double>(shown + 1) / static_cast<double>(shown + hidden + 1);
  }
  auto alike = find_alike(sums, rgb.size() > 0);
  return {std::move(renamed), std::move(total), std::move(weight), std::move(extent),
          std::move(size),    std::move(pure),  std::move(figure), std::move(alike),
          std::move(touching), std::move(gap),  std::move(front)};
}

inline PyMethodDef METHODS[] = {
    binding::method<measure>("measure", "The fields of Parts, with rows 0 of what is no part."),
    {nullptr, nullptr, 0, nullptr},
};
}  // namespace objreg::parts
