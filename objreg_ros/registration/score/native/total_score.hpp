// SPDX-License-Identifier: Apache-2.0
// The kernels of total_score.py.
#pragma once
#include "objreg_ros/registration/kernels/native/least_squares.hpp"
#include "objreg_ros/registration/score/native/view_score.hpp"
#include "objreg_ros/registration/shapes/native/silhouette_score.hpp"

namespace objreg::total_score {
constexpr double ANGLE = 0.08, SHIFT = 0.015;  // rad and m: the first steps of a climb
constexpr double LAST = 0.12;                  // of them: the shortest
constexpr int ROUNDS = 10;
constexpr double GAIN = 0.004;  // of score that a step must bring

using Sight = std::tuple<View<const float, 2>, View<const float, 1>, free_space::Image>;  // points, shades, image
using Views = std::tuple<Sight, Sight, std::array<double, 2>, bool>;  // of source and target, slops, whether textured
struct Poses { Array<double, 2> T, back; };
// What is asked of a motion: the views, both shapes, their extent, the weights and how many points a side at most.
struct Question {
  const Views &views;
  const shape::Arrays &source, &target;
  double extent;
  View<const double, 1> weights;  // of `weights_of`, of the silhouette score and of violations
  i64 most;
};

// The pose (4, 4) of the source's camera in the target's under an upright motion, and its inverse.
inline Poses poses_of(const shape::Arrays &source, const shape::Arrays &target, View<const double, 1> motion) {
  const auto R_source = std::get<3>(source), R_target = std::get<3>(target);
  const auto origin = std::get<4>(source), other_origin = std::get<4>(target);
  const double c = std::cos(motion(0)), s = std::sin(motion(0));
  double turned[3][3];
  for (int k = 0; k < 3; k++) {
    turned[0][k] = c * R_source(0, k) - s * R_source(1, k);
    turned[1][k] = s * R_source(0, k) + c * R_source(1, k);
    turned[2][k] = R_source(2, k);
  }
  const double shift[3] = {motion(1) + other_origin(0) - c * origin(0) + s * origin(1),
                           motion(2) + other_origin(1) - s * origin(0) - c * origin(1),
                           motion(3) + other_origin(2) - origin(2)};
  Poses out{zeros<double, 2>(4, 4), Array<double, 2>(4, 4)};
  for (int i = 0; i < 3; i++)
    for (int j = 0; j < 3; j++) {
      for (int k = 0; k < 3; k++) out.T(i, j) += R_target(k, i) * turned[k][j];
      out.T(i, 3) += R_target(j, i) * shift[j];
    }
  out.T(3, 3) = 1.0;
  least_squares::invert(out.T, out.back);
  return out;
}

// What an image says of the first `most` points of a view under T.
inline free_space::Counts counted(const Sight &asked, View<const double, 2> T, const Sight &seen,
                                  std::array<double, 2> slops, i64 most) {
  const auto &[points, shades, own] = asked;
  const auto &[near, far, detail, camera] = std::get<2>(seen);
  const i64 n = std::min(most, points.size());
  return free_space::counted(points.cut(0, n), shades.cut(0, n), T, near, far, detail, camera, slops[0], slops[1]);
}

// V of an upright motion, less what is in seen free space once more: an upright pose has no tilt to excuse it.
inline double view_score_of(const Question &of, View<const double, 1> motion) {
  using namespace free_space;
  const auto &[source, target, slops, textured] = of.views;
  const double violated = of.weights(of.weights.size() - 1);
  const Poses poses = poses_of(of.source, of.target, motion);
  const Counts forward = counted(source, poses.T, target, slops, of.most);
  const Counts backward = counted(target, poses.back, source, slops, of.most);
  const i64 asked = std::min(of.most, std::get<0>(source).size()) + std::min(of.most, std::get<0>(target).size());
  const double floating = std::max(forward[VIOLATIONS] / std::max(forward[SEEN], 1.0),
                                   backward[VIOLATIONS] / std::max(backward[SEEN], 1.0));
  return view_score::value_quickly(forward, backward, textured, asked) - violated * floating;
}

// The view score, and the weighed silhouette score of the objects, -1 to 1.
inline double total_score_of(const Question &of, View<const double, 1> motion) {
  const double alike = silhouette_score::two_way(of.source, of.target, motion, of.extent, of.weights, of.most);
  const double weight = of.weights(of.weights.size() - 2);
  return view_score_of(of, motion) + weight * std::max(-1.0, std::min(1.0, alike));
}

// The total scores (K,) of motions (K, 4).
inline Array<double, 1> total_scores(Views views, shape::Arrays source, shape::Arrays target,
                                     View<const double, 2> motions, double extent, View<const double, 1> weights,
                                     i64 most) {
  const Question of{views, source, target, extent, weights, most};
  Array<double, 1> found(motions.size());
  for (i64 k = 0; k < motions.size(); k++) found(k) = total_score_of(of, motions.row(k));
  return found;
}

// Turn `motion` (4,), in place, to where its view score is best, and bring it to where its total score is highest.
inline void climb(Views views, shape::Arrays source, shape::Arrays target, View<double, 1> motion,
                  View<const double, 1> turns, double extent, View<const double, 1> weights, i64 most) {
  const Question of{views, source, target, extent, weights, most};
  Array<double, 1> trial(4);
  std::copy_n(motion.data, 4, trial.data);
  double best = -std::numeric_limits<double>::infinity(), yaw = motion(0);
  for (i64 k = 0; k < turns.size(); k++) {
    trial(0) = motion(0) + turns(k);
    const double seen = view_score_of(of, trial);
    if (seen > best) best = seen, yaw = trial(0);
  }
  motion(0) = yaw;
  best = total_score_of(of, motion);
  double angle = ANGLE, shift = SHIFT;
  for (int round = 0; round < ROUNDS; round++) {
    bool improved = false;
    for (int k = 0; k < 6; k++) {
      std::copy_n(motion.data, 4, trial.data);
      trial(k / 2) += (k < 2 ? angle : shift) * (k % 2 == 0 ? 1.0 : -1.0);
      const double found = total_score_of(of, trial);
      if (found > best + GAIN) {
        best = found, improved = true;
        std::copy_n(trial.data, 4, motion.data);
      }
    }
    if (improved) continue;
    angle *= 0.5, shift *= 0.5;
    if (angle < LAST * ANGLE) break;
  }
}

inline std::tuple<Array<double, 2>, Array<double, 2>> poses(shape::Arrays source, shape::Arrays target,
                                                            View<const double, 1> motion) {
  Poses made = poses_of(source, target, motion);
  return {std::move(made.T), std::move(made.back)};
}

inline PyMethodDef METHODS[] = {
    binding::method<climb>("climb", "Brings a motion (4,) to where its total score is highest."),
    binding::method<poses>("poses", "The pose (4, 4) of the source's camera under a motion (4,), and its inverse."),
    binding::method<total_scores>("total_scores", "The total scores (K,) of motions (K, 4)."),
    {nullptr, nullptr, 0, nullptr},
};
}  // namespace objreg::total_score
