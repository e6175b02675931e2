// SPDX-License-Identifier: Apache-2.0
// The kernels of upright_search.py.
#pragma once
#include "objreg_ros/native/binding.hpp"
#include "objreg_ros/registration/shapes/native/silhouette_score.hpp"
#include "objreg_ros/registration/shapes/native/upright_icp.hpp"
#include "objreg_ros/registration/shapes/native/visual_hull.hpp"

namespace objreg::upright_search {
using shape::Arrays, silhouette_score::climbed, silhouette_score::two_way;
using upright_icp::Grid, upright_icp::settled, visual_hull::cleared;

constexpr double TAU = 6.283185307179586;
constexpr double SAME_TURN = 0.12, SAME_SHIFT = 0.015;  // rad and m within which two motions are one
constexpr double ALIKE_TURN = 0.5;                      // rad within which motions turn alike
constexpr i64 CROWD = 2;                                // and how many of them are refined
constexpr double CLIMB[] = {0.05, 0.012, 0.012, 0.0};   // rad and m: the first steps of a climb; the height is kept
constexpr i64 CLEARED_AT_LAST[] = {200, 5};             // points a side and steps out of free space

using Motion = View<const double, 1>;

// How far apart two motions turn, rad.
inline double turn_between(Motion a, Motion b) { return std::abs(std::remainder(a(0) - b(0), TAU)); }

inline bool known(Motion motion, View<const double, 2> others, i64 n) {
  for (i64 k = 0; k < n; k++) {
    const double shift = std::abs(motion(1) - others(k, 1)) + std::abs(motion(2) - others(k, 2));
    if (turn_between(motion, others.row(k)) < SAME_TURN && shift < SAME_SHIFT) return true;
  }
  return false;
}

// How many others turn about as far: what looks much the same after half a turn keeps places for both.
inline i64 crowd(Motion motion, View<const double, 2> others, i64 n) {
  i64 count = 0;
  for (i64 k = 0; k < n; k++) count += turn_between(motion, others.row(k)) < ALIKE_TURN;
  return count;
}

// Fill `order` with the indices of scores, the highest first, by insertion: they are few.
inline void rank(View<const double, 1> scores, View<i64, 1> order) {
  for (i64 k = 0; k < scores.size(); k++) {
    i64 at = k;
    while (at > 0 && scores(order(at - 1)) < scores(k)) {
      order(at) = order(at - 1);
      at--;
    }
    order(at) = k;
  }
}

// The higher of two scores, and in `motion` what has it: itself, or `trial`.
inline double better(const Arrays &source, const Arrays &target, View<double, 1> trial, View<double, 1> motion,
                     double score, double extent, View<const double, 1> weights, i64 most) {
  const double found = two_way(source, target, trial, extent, weights, most);
  if (found < score) return score;
  std::copy_n(trial.data, 4, motion.data);
  return found;
}

// Each start brought to where it floats least, and from there to its basin: (motions (K, 4), scores (K,)). The latter
// only where both silhouettes score it no lower: opposite sides of an object have next to no surface in common, and
// would be drawn together.
inline std::tuple<Array<double, 2>, Array<double, 1>> started(Arrays source, Arrays target, Grid grid,
                                                              View<const double, 2> starts, double extent,
                                                              View<const double, 1> weights, i64 most, double reach,
                                                              std::array<i64, 2> steps) {
  Array<double, 2> motions(starts.size(), 4);
  Array<double, 1> scores(starts.size()), trial(4);
  for (i64 k = 0; k < starts.size(); k++) {
    const auto motion = motions.row(k);
    std::copy_n(starts.row(k).data, 4, motion.data);
    cleared(source, target, motion, steps[0], steps[1]);
    scores(k) = two_way(source, target, motion, extent, weights, most);
    std::copy_n(motion.data, 4, trial.data);
    settled(std::get<0>(source), std::get<1>(source), most, grid, trial, reach, 0.4 * reach, 8);
    scores(k) = better(source, target, trial, motion, scores(k), extent, weights, most);
  }
  return {std::move(motions), std::move(scores)};
}

// The best distinct motions, refined with every point, the first of them climbed: (motions, scores). `numbers` are
// those that are kept, those that are climbed, and a climb's rounds. What is below the best by more than `margin` is
// not climbed.
inline std::tuple<Array<double, 2>, Array<double, 1>> finish(Arrays source, Arrays target, Grid grid,
                                                             View<const double, 2> motions,
                                                             View<const double, 1> scores, double extent,
                                                             View<const double, 1> weights, std::array<i64, 3> numbers,
                                                             double margin, double reach) {
  const auto [kept, most_climbed, rounds] = numbers;
  const auto P = std::get<0>(source), N = std::get<1>(source);
  const i64 every = P.size();
  const double cell = std::get<4>(grid);
  Array<double, 2> best(kept, 4);
  Array<double, 1> trial(4), refined(kept), steps(4);
  Array<i64, 1> order(scores.size());
  std::copy_n(CLIMB, 4, steps.data);
  i64 n = 0;
  rank(scores, order);
  for (i64 k = 0; k < order.size() && n < kept; k++) {
    const Motion start = motions.row(order(k));
    if (known(start, best, n) || crowd(start, best, n) >= CROWD) continue;
    std::copy_n(start.data, 4, best.row(n).data);
    n++;
  }
  const auto try_from = [&](i64 k) {
    std::copy_n(best.row(k).data, 4, trial.data);
    return View<double, 1>(trial);
  };
  const auto judge = [&](i64 k) {
    refined(k) = better(source, target, trial, best.row(k), refined(k), extent, weights, every);
  };
  for (i64 k = 0; k < n; k++) {
    refined(k) = two_way(source, target, best.row(k), extent, weights, every);
    cleared(source, target, try_from(k), CLEARED_AT_LAST[0], CLEARED_AT_LAST[1]);
    judge(k);
    settled(P, N, every, grid, try_from(k), reach, std::max(1.5 * cell, 0.008), 12);
    judge(k);
  }
  rank(refined.cut(0, n), order);
  const double top = n ? refined(order(0)) : 0.0;
  for (i64 at = 0; at < std::min(n, most_climbed); at++) {
    const i64 k = order(at);
    if (refined(k) < top - margin) break;
    refined(k) = climbed(source, target, best.row(k), extent, weights, every, steps, rounds);
    settled(P, N, every, grid, try_from(k), std::max(1.5 * cell, 0.010), std::max(1.2 * cell, 0.006), 8);
    judge(k);
  }
  return {std::move(best).first(n), std::move(refined).first(n)};
}

inline PyMethodDef METHODS[] = {
    binding::method<started>("started", "Motions (K, 4) that float least or in their basins, and their scores (K,)."),
    binding::method<finish>("finish", "The best distinct motions (n, 4), refined and climbed, and their scores (n,)."),
    {nullptr, nullptr, 0, nullptr},
};
}  // namespace objreg::upright_search
