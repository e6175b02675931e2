// SPDX-License-Identifier: Apache-2.0
// The kernels of retrieval.py.
#pragma once
#include "objreg_ros/native/binding.hpp"

namespace objreg::retrieval {
constexpr double GAP_SIGMA_M = 0.08;  // deviation of the distance of two objects' middles from one view to another

inline double gap(View<const double, 2> xyz, i64 i, i64 j) {
  const double x = xyz(i, 0) - xyz(j, 0), y = xyz(i, 1) - xyz(j, 1), z = xyz(i, 2) - xyz(j, 2);
  return std::sqrt(x * x + y * y + z * z);
}

// The votes of pairs of one keyframe's objects: each object has as much to give as by itself, over all others. `best`,
// as large as `asked_gaps`, is scratch.
inline double arranged(View<const i64, 1> rows, View<const i64, 1> ballots, View<const double, 1> votes,
                       View<const double, 2> xyz, View<const double, 2> asked_gaps, View<double, 2> best) {
  if (rows.size() < 2 || ballots(rows(0)) == ballots(rows(rows.size() - 1))) return 0.0;
  const i64 objects = asked_gaps.size();
  best.fill(0.0);
  for (i64 i = 0; i < rows.size(); i++) {
    for (i64 j = 0; j < i; j++) {
      const i64 a = ballots(rows(j)), b = ballots(rows(i));
      if (a == b) continue;  // two answers to one object
      const double apart = gap(xyz, rows(i), rows(j));
      if (apart == 0.0) continue;  // one answer to two
      const double off = (apart - asked_gaps(a, b)) / GAP_SIGMA_M;
      const double vote = std::sqrt(votes(rows(i)) * votes(rows(j))) * std::exp(-0.5 * off * off);
      best(a, b) = std::max(best(a, b), vote);
    }
  }
  double total = 0.0;
  for (i64 k = 0; k < objects * objects; k++) total += best.data[k];
  return total / (objects - 1);
}

// A row of each keyframe, the oldest first, and its votes: of each ballot the first, its nearest object's. And those of
// pairs of objects that are as far from each other as the two that were asked for.
inline std::tuple<Array<i64, 1>, Array<double, 1>> tally(View<const i64, 1> keyframe_ids, View<const i64, 1> ballots,
                                                         View<const double, 1> votes, View<const double, 2> xyz,
                                                         View<const double, 2> asked_xyz) {
  const i64 objects = asked_xyz.size(), size = keyframe_ids.size();
  Array<double, 2> asked_gaps(objects, objects), best(objects, objects);
  for (i64 i = 0; i < objects; i++)
    for (i64 j = 0; j < objects; j++) asked_gaps(i, j) = gap(asked_xyz, i, j);
  Array<i64, 1> order(size), first(size);
  for (i64 k = 0; k < size; k++) order(k) = k;
  std::stable_sort(order.data, order.data + size, [&](i64 a, i64 b) { return keyframe_ids(a) < keyframe_ids(b); });
  auto total = zeros<double, 1>(size);
  i64 found = 0, start = 0;
  while (start < size) {
    i64 stop = start + 1;
    while (stop < size && keyframe_ids(order(stop)) == keyframe_ids(order(start))) stop++;
    const View<i64, 1> rows = order.cut(start, stop);
    first(found) = rows(0);
    for (i64 k = 0; k < rows.size(); k++)
      if (k == 0 || ballots(rows(k)) != ballots(rows(k - 1))) total(found) += votes(rows(k));
    total(found) += arranged(rows, ballots, votes, xyz, asked_gaps, best);
    found++, start = stop;
  }
  return {std::move(first).first(found), std::move(total).first(found)};
}

// The order of places: always the one with the most votes; each lowers those of the others by its row.
inline Array<i64, 1> in_turn(View<const double, 1> votes, View<const double, 2> factors) {
  const i64 size = votes.size();
  Array<double, 1> left(size);
  std::copy_n(votes.data, size, left.data);
  Array<i64, 1> order(size);
  for (i64 turn = 0; turn < size; turn++) {
    const i64 best = std::max_element(left.data, left.data + size) - left.data;
    order(turn) = best;
    const View<const double, 1> factor = factors.row(best);
    for (i64 k = 0; k < size; k++) left(k) *= factor(k);
    for (i64 k = 0; k <= turn; k++) left(order(k)) = -1.0;
  }
  return order;
}

inline PyMethodDef METHODS[] = {
    binding::method<tally>("tally", "A row of each keyframe, the oldest first, and its votes."),
    binding::method<in_turn>("in_turn", "The order of places, each of which lowers the votes of others by its row."),
    {nullptr, nullptr, 0, nullptr},
};
}  // namespace objreg::retrieval
