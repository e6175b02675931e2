// SPDX-License-Identifier: Apache-2.0
// The kernels of components.py.
#pragma once
#include "objreg_ros/native/binding.hpp"

namespace objreg::components {
inline i32 root(View<i32, 1> parent, i32 k) {
  while (parent(k) != k) {
    parent(k) = parent(parent(k));
    k = parent(k);
  }
  return k;
}

inline void join(View<i32, 1> parent, i32 k, i32 other) {
  const i32 r = root(parent, k), s = root(parent, other);
  parent(std::max(r, s)) = std::min(r, s);
}

// Turn the runs in `labels` into parts of `least` cells or more, 1 ... count by their first cells.
inline i64 number_parts(View<i32, 1> parent, View<i32, 1> size, i64 least, View<i32, 2> labels) {
  auto number = zeros<i32, 1>(parent.size());
  const i32 runs = static_cast<i32>(parent.size());
  for (i32 run = runs - 1; run > 0; run--)
    if (parent(run) != run) size(root(parent, run)) += size(run);
  i32 count = 0;
  for (i32 run = 1; run < runs; run++) {
    const i32 first = root(parent, run);
    // A root is the first run of its part, so it is met before the others.
    if (first == run && size(run) >= least) number(run) = ++count;
    else if (first != run) number(run) = number(first);
  }
  for (i64 i = 0; i < labels.shape[0]; i++) {
    const auto row = labels.row(i);
    for (i64 j = 0; j < row.size(); j++) row(j) = number(row(j));
  }
  return count;
}

// Fill `labels`: first with runs, the linked cells of a row; runs of two rows are joined where they touch.
inline i64 label_parts(View<const float, 2> depth, View<const bool, 2> keep, float a, float b, i64 least,
                       View<i32, 2> labels) {
  const i64 h = depth.shape[0], w = depth.shape[1];
  Array<i32, 1> parent(h * w + 1), size(h * w + 1);
  parent(0) = size(0) = 0;
  i32 runs = 0;
  for (i64 i = 0; i < h; i++) {
    const auto here = depth.row(i);
    const auto kept = keep.row(i);
    const auto out = labels.row(i);
    i32 joined = 0, joined_above = 0;
    for (i64 j = 0; j < w; j++) {
      out(j) = 0;
      if (!kept(j)) continue;
      const float z = here(j), jump = a + b * z * z;
      i64 back = j > 1 && here(j - 1) == 0.0f ? 2 : 1;
      i32 run;
      if (j >= back && kept(j - back) && std::abs(here(j - back) - z) < jump) run = out(j - back);
      else {
        run = ++runs;
        parent(run) = run;
        size(run) = 0;
      }
      size(run)++;
      out(j) = run;
      back = i > 1 && depth(i - 1, j) == 0.0f ? 2 : 1;
      if (i >= back && keep(i - back, j) && std::abs(depth(i - back, j) - z) < jump) {
        const i32 above = labels(i - back, j);
        if (above != joined_above || run != joined) {
          join(parent, run, above);
          joined = run, joined_above = above;
        }
      }
    }
  }
  return number_parts(parent.cut(0, runs + 1), size.cut(0, runs + 1), least, labels);
}

// The labels (h, w), and the number of parts.
inline std::tuple<Array<i32, 2>, i64> connect(View<const float, 2> depth, View<const bool, 2> keep, float a, float b) {
  Array<i32, 2> labels(depth.shape[0], depth.shape[1]);
  const i64 count = label_parts(depth, keep, a, b, 1, labels);
  return {std::move(labels), count};
}

// The label of the neighbour of cell (i, j) that is nearest in depth; 0 if none is within a depth jump.
inline i32 nearest_label(View<const i32, 2> labels, View<const float, 2> depth, i64 i, i64 j, float a, float b) {
  const float z = depth(i, j);
  float nearest = a + b * z * z;
  i32 label = 0;
  const auto ask = [&](i64 p, i64 q) {
    if (p < 0 || q < 0 || p >= depth.shape[0] || q >= depth.shape[1] || labels(p, q) <= 0) return;
    const float step = std::abs(depth(p, q) - z);
    if (step < nearest) nearest = step, label = labels(p, q);
  };
  ask(i - 1, j), ask(i + 1, j), ask(i, j - 1), ask(i, j + 1);
  return label;
}

// Let the parts grow in place into the cells of `keep` that have no label, one ring of cells a round. A cell takes the
// label of the neighbour nearest in depth; where two parts grow towards each other they meet half way.
inline void grow(View<i32, 2> labels, View<const float, 2> depth, View<const bool, 2> keep, float a, float b,
                 i64 rounds) {
  const i64 h = depth.shape[0], w = depth.shape[1];
  Array<i32, 2> bare(h * w, 3);  // rows and columns of the cells without a label, and the label found
  i64 n = 0;
  for (i64 i = 0; i < h; i++) {
    const auto kept = keep.row(i);
    const auto label = labels.row(i);
    for (i64 j = 0; j < w; j++) {
      if (!(kept(j) && label(j) == 0)) continue;
      bare(n, 0) = static_cast<i32>(i), bare(n, 1) = static_cast<i32>(j);
      n++;
    }
  }
  for (i64 round = 0; round < rounds; round++) {
    for (i64 k = 0; k < n; k++) bare(k, 2) = nearest_label(labels, depth, bare(k, 0), bare(k, 1), a, b);
    i64 left = 0;
    for (i64 k = 0; k < n; k++) {
      labels(bare(k, 0), bare(k, 1)) = bare(k, 2);
      if (bare(k, 2) != 0) continue;
      bare(left, 0) = bare(k, 0), bare(left, 1) = bare(k, 1);
      left++;
    }
    if (left == n) return;
    n = left;
  }
}

// The labels (h, w), and the number of parts.
inline std::tuple<Array<i32, 2>, i64> split(View<const float, 2> depth, View<const bool, 2> level,
                                            View<const bool, 2> seams, float a, float b, i64 least, i64 rounds) {
  const i64 h = depth.shape[0], w = depth.shape[1];
  Array<i32, 2> labels(h, w);
  Array<bool, 2> keep(h, w), solid(h, w);
  for (i64 i = 0; i < h; i++) {
    const auto z = depth.row(i);
    const auto flat = level.row(i), seam = seams.row(i);
    const auto kept = keep.row(i), whole = solid.row(i);
    for (i64 j = 0; j < w; j++) {
      kept(j) = (z(j) > 0.0f) & !flat(j);
      whole(j) = kept(j) & !seam(j);
    }
  }
  const i64 count = label_parts(depth, solid, a, b, least, labels);
  grow(labels, depth, keep, a, b, rounds);
  return {std::move(labels), count};
}

inline PyMethodDef METHODS[] = {
    binding::method<connect>("connect", "The labels of the connected parts, and their number."),
    binding::method<split>("split", "The labels of the parts that seams part, and their number."),
    {nullptr, nullptr, 0, nullptr},
};
}  // namespace objreg::components
