// SPDX-License-Identifier: Apache-2.0
// The kernels of view_score.py.
#pragma once
#include "objreg_ros/registration/score/native/free_space.hpp"

namespace objreg::view_score {
using free_space::Counts;
constexpr double NO_TEXTURE = 0.2;  // what stands in for the texture of a view without grey, as in view_score.py
constexpr double WORST = -3.0;      // V where there is nothing to look at, as in view_score.py
constexpr double NEUTRAL = 0.65;    // what a wrong pose at its best reaches

// V of the counts of both ways, of which `asked` points were asked, and of the correlation of `grey`. It is made of the
// worse way's inliers and violations, the texture and the share of all points that could be tested. The weights are set
// by hand, near those of a logistic fit; a view without grey counts as a weak match.
inline double value(const Counts &forward, const Counts &backward, double grey, i64 asked) {
  using namespace free_space;
  const double seen_a = forward[SEEN], seen_b = backward[SEEN];
  if (std::min(seen_a, seen_b) < 1.0) return WORST;
  const double inliers = std::min(forward[INLIERS] / seen_a, backward[INLIERS] / seen_b);
  const double violations = std::max(forward[VIOLATIONS] / seen_a, backward[VIOLATIONS] / seen_b);
  const double share = std::max((seen_a + seen_b) / static_cast<double>(asked), 1e-3);
  return grey + inliers - 3.0 * violations + 0.5 * std::log10(share) - NEUTRAL;
}

// V with the grey of each image's own band.
inline double value_quickly(const Counts &forward, const Counts &backward, bool textured, i64 asked) {
  Counts both;
  for (int k = 0; k < free_space::COUNTS; k++) both[k] = forward[k] + backward[k];
  return value(forward, backward, textured ? free_space::correlated(both) : NO_TEXTURE, asked);
}

// The same for Python: of counts (10,), and of many (K, 10).
inline double rated(View<const double, 1> forward, View<const double, 1> backward, double grey, i64 asked) {
  return value(free_space::counts_of(forward), free_space::counts_of(backward), grey, asked);
}
inline double rated_quickly(View<const double, 1> forward, View<const double, 1> backward, bool textured, i64 asked) {
  return value_quickly(free_space::counts_of(forward), free_space::counts_of(backward), textured, asked);
}
inline Array<double, 1> rated_many(View<const double, 2> forward, View<const double, 2> backward, bool textured,
                                   i64 asked) {
  Array<double, 1> V(forward.size());
  for (i64 k = 0; k < V.size(); k++) V(k) = rated_quickly(forward.row(k), backward.row(k), textured, asked);
  return V;
}

inline PyMethodDef METHODS[] = {
    binding::method<rated>("rated", "V of the counts (10,) of both ways and the correlation of grey."),
    binding::method<rated_many>("rated_many", "V (K,) of many counts (K, 10), with the grey of each image's own band."),
    binding::method<rated_quickly>("rated_quickly", "V with the grey of each image's own band."),
    {nullptr, nullptr, 0, nullptr},
};
}  // namespace objreg::view_score
