// SPDX-License-Identifier: Apache-2.0
// The kernels of nearest_neighbours.py.
#pragma once
#include "objreg_ros/native/binding.hpp"

namespace objreg::nearest_neighbours {
constexpr i64 LANES = 64;  // objects of a tile, as in nearest_neighbours.py
constexpr double ROUNDING = 1e-5;  // relative: what single precision may lose in a comparison, with a margin
constexpr float NOWHERE = std::numeric_limits<float>::infinity();  // half the squared length of a row that is free

struct Item {
  float similarity;
  i64 older, row;

  bool operator>(const Item &other) const {
    if (similarity != other.similarity) return similarity > other.similarity;
    if (older != other.older) return older > other.older;
    return row > other.row;
  }
};
inline bool after(const Item &a, const Item &b) { return a > b; }  // the order of a heap whose first is the least

struct Seen {  // what is looked at: the tiles, who asks, and what is left out
  View<const float, 3> descriptors;
  View<const float, 2> half_norms;
  View<const float, 1> tops;
  View<const double, 2> where;
  View<const i64, 2> when;
  View<const float, 1> descriptor;
  View<const double, 1> position;
  double way;
  i64 stamp_ns, session, gap_ns;
  double radius, drift;
  View<const i64, 1> own, hidden;
  double margin;
};

// The largest of a tile's numbers, by halves: the processor compares many at once.
inline float largest(const float *of) {
  float best[LANES / 2];
  for (i64 k = 0; k < LANES / 2; k++) best[k] = of[k + LANES / 2] > of[k] ? of[k + LANES / 2] : of[k];
  for (i64 half = LANES / 4; half > 0; half /= 2)
    for (i64 k = 0; k < half; k++) best[k] = best[k + half] > best[k] ? best[k + half] : best[k];
  return best[0];
}

// The similarity of every object of a tile, into `out`; the largest comes back.
inline float compare(View<const float, 2> descriptors, View<const float, 1> half_norms, View<const float, 1> descriptor,
                     float *__restrict out) {
  const float *__restrict lengths = half_norms.data;
  for (i64 lane = 0; lane < LANES; lane++) out[lane] = -lengths[lane];
  for (i64 k = 0; k < descriptor.size(); k++) {
    const float *__restrict column = descriptors.row(k).data;
    const float factor = descriptor(k);
    for (i64 lane = 0; lane < LANES; lane++) out[lane] += factor * column[lane];
  }
  return largest(out);
}

// The same by the bytes, three dimensions at once: a third less time. Their number is a multiple of three.
inline float compare_bytes(View<const std::int8_t, 2> steps, View<const float, 1> half_norms,
                           View<const float, 1> descriptor, float *__restrict out) {
  const float *__restrict lengths = half_norms.data;
  for (i64 lane = 0; lane < LANES; lane++) out[lane] = -lengths[lane];
  for (i64 k = 0; k < descriptor.size(); k += 3) {
    const float a = descriptor(k), b = descriptor(k + 1), c = descriptor(k + 2);
    const std::int8_t *__restrict of_a = steps.row(k).data, *__restrict of_b = steps.row(k + 1).data;
    const std::int8_t *__restrict of_c = steps.row(k + 2).data;
    for (i64 lane = 0; lane < LANES; lane++) out[lane] += a * of_a[lane] + b * of_b[lane] + c * of_c[lane];
  }
  return largest(out);
}

// The most that an object of each tile can be similar, by the bytes; `step` is what one of them stands for.
inline Array<float, 1> promised(View<const std::int8_t, 3> steps, View<const float, 2> half_norms,
                                View<const float, 2> spans, View<const float, 1> descriptor,
                                View<const float, 1> step) {
  Array<float, 1> tops(half_norms.size()), scaled(descriptor.size());
  float out[LANES], square = 0.0f;
  for (i64 k = 0; k < descriptor.size(); k++) {
    square += descriptor(k) * descriptor(k);
    scaled(k) = descriptor(k) * step(k);
  }
  const float length = std::sqrt(square);
  for (i64 tile = 0; tile < tops.size(); tile++) {
    const float off = spans(tile, 0), reach = spans(tile, 1);
    const double unsure = length * off + ROUNDING * reach * (reach + length);
    tops(tile) = static_cast<float>(compare_bytes(steps.row(tile), half_norms.row(tile), scaled, out) + unsure);
  }
  return tops;
}

// Whether a number is among sorted ones.
inline bool holds(View<const i64, 1> numbers, i64 number) {
  return std::binary_search(numbers.data, numbers.data + numbers.size(), number);
}

// Whether two stamps are nearer than a gap. They may be as far apart as 64 bits are.
inline bool nearer(i64 a, i64 b, i64 gap) {
  const u64 apart = static_cast<u64>(a) - static_cast<u64>(b);
  return static_cast<i64>(a < b ? -apart : apart) < gap;
}

// Put the most similar of the tiles that promise from `low` to below `high` on the heap `best`. None is -inf. The
// highest similarity so far goes in and comes back.
inline float look(View<Item, 1> best, float closest, float low, float high, const Seen &seen) {
  float similarity[LANES];
  Item *first = best.data, *last = best.data + best.size();
  for (i64 tile = 0; tile < seen.tops.size(); tile++) {
    const float top = seen.tops(tile);
    const double least = std::max<double>(best(0).similarity, closest - seen.margin);
    if (top < std::max<double>(least, low) || top >= high || top == -NOWHERE) continue;
    if (compare(seen.descriptors.row(tile), seen.half_norms.row(tile), seen.descriptor, similarity) < least) continue;
    for (i64 lane = 0; lane < LANES; lane++) {
      const float score = similarity[lane];
      if (!(score >= least) || score == -NOWHERE) continue;
      const i64 row = tile * LANES + lane;
      const View<const i64, 1> when = seen.when.row(row);
      if (holds(seen.hidden, when(1))) continue;
      if (nearer(when(0), seen.stamp_ns, seen.gap_ns) && holds(seen.own, when(1))) continue;
      if (when(1) == seen.session && when(3)) {
        const View<const double, 1> where = seen.where.row(row);
        const double reach = seen.radius + seen.drift * std::abs(seen.way - where(3));
        const double x = where(0) - seen.position(0), y = where(1) - seen.position(1), z = where(2) - seen.position(2);
        if (x * x + y * y + z * z > reach * reach) continue;
      }
      const Item item = {score, -when(2), row};
      if (item > best(0)) {
        std::pop_heap(first, last, after);
        last[-1] = item;
        std::push_heap(first, last, after);
      }
      closest = std::max(closest, score);
    }
  }
  return closest;
}

// The rows, the nearest first, and their similarity: half the squared distance below half a length. The tiles that
// promise most come first. What they hold is mostly so alike that few others need be seen.
inline std::tuple<Array<i64, 1>, Array<float, 1>> closest(
    View<const float, 3> descriptors, View<const std::int8_t, 3> steps, View<const float, 2> half_norms,
    View<const float, 2> spans, View<const double, 2> where, View<const i64, 2> when, View<const float, 1> descriptor,
    View<const float, 1> step, View<const double, 1> position, double way, i64 stamp_ns, i64 session, i64 gap_ns,
    double radius, double drift, View<const i64, 1> own, View<const i64, 1> hidden, i64 most, double margin) {
  const auto tops = promised(steps, half_norms, spans, descriptor, step);
  float floor = -NOWHERE;
  if (tops.size() > most) {
    Array<float, 1> sorted(tops.size());
    std::copy_n(tops.data, tops.size(), sorted.data);
    float *at = sorted.data + (tops.size() - most);
    std::nth_element(sorted.data, at, sorted.data + tops.size(),
                     [](float a, float b) { return a < b || (b != b && a == a); });  // NaN is last
    floor = *at;
  }
  const Seen seen = {descriptors, half_norms, tops,   where,  when,  descriptor, position, way,
                     stamp_ns,    session,    gap_ns, radius, drift, own,        hidden,   margin};
  const auto best = full<Item, 1>({-NOWHERE, 0, 0}, most);  // as a heap: the least is the first
  const float highest = look(best, -NOWHERE, floor, NOWHERE, seen);
  look(best, highest, -NOWHERE, floor, seen);
  std::sort(best.data, best.data + most, after);
  i64 near = 0;
  while (near < most && best(near).similarity > std::max<double>(best(0).similarity - margin, -NOWHERE)) near++;
  Array<i64, 1> rows(near);
  Array<float, 1> scores(near);
  for (i64 k = 0; k < near; k++) rows(k) = best(k).row, scores(k) = best(k).similarity;
  return {std::move(rows), std::move(scores)};
}

inline PyMethodDef METHODS[] = {
    binding::method<closest>("closest", "The rows, the nearest first, and their similarity."),
    {nullptr, nullptr, 0, nullptr},
};
}  // namespace objreg::nearest_neighbours
