// SPDX-License-Identifier: Apache-2.0
// The kernels of silhouette_score.py.
#pragma once
#include "objreg_ros/native/binding.hpp"
#include "objreg_ros/registration/kernels/native/projection.hpp"
#include "objreg_ros/registration/shapes/native/shape.hpp"

namespace objreg::silhouette_score {
using silhouette::INSIDE, silhouette::RIM;

constexpr double NEAR_M = 0.4;  // of sensor.py: m, where the noise of depth is least
constexpr i64 LEAST_SHADED = 20;
// What `tally` counts, as in silhouette_score.py.
enum { INLIERS, VIOLATIONS, HIDDEN, RESIDUAL, SHADED, SUM_A, SUM_B, SUM_AA, SUM_BB, SUM_AB, COUNTS };

// How far two depths of one surface may differ at a depth z, m: `Silhouette.tolerance`.
inline double tolerance_at(double z, View<const double, 1> tolerance) {
  return tolerance(0) + tolerance(1) * (z - NEAR_M) * (z - NEAR_M);
}

// Whether a normal that is turned by T looks back along the ray (x, y, 1).
inline bool faces(View<const double, 2> T, double a, double b, double c, double x, double y) {
  const double along_x = T(0, 0) * a + T(0, 1) * b + T(0, 2) * c;
  const double along_y = T(1, 0) * a + T(1, 1) * b + T(1, 2) * c;
  return along_x * x + along_y * y + T(2, 0) * a + T(2, 1) * b + T(2, 2) * c < 0.0;
}

// Add to `out (10,)` what a silhouette says of the first `most` points under T (3, 4), camera from points.
inline i64 tally(View<const float, 2> P, View<const float, 2> N, View<const float, 1> S, i64 most,
                 View<const double, 2> T, View<const float, 2> depth, View<const u8, 2> mask, View<const float, 2> grey,
                 View<const double, 1> camera, View<const double, 1> tolerance, double extent, View<double, 1> out) {
  const double height = depth.shape[0], width = depth.shape[1];
  const i64 count = std::min(most, P.size());
  const auto places = projection::project(P.cut(0, count), T, camera);
  double sums[COUNTS] = {};
  for (i64 i = 0; i < count; i++) {
    const double u = places.x(i), v = places.y(i), z = places.z(i);
    if (!((z >= projection::LEAST_DEPTH) & (u >= 0.0) & (v >= 0.0) & (u < width) & (v < height))) continue;
    const u32 row = static_cast<u32>(v), column = static_cast<u32>(u);
    const double d = depth(row, column);
    if (d <= 0.0) continue;
    const u8 on = mask(row, column);
    const double within = tolerance_at(z, tolerance), e = z - d;
    if (e < -within) {
      if (on != RIM) sums[VIOLATIONS] += 1.0;
    } else if (e > within) {
      sums[HIDDEN] += on == INSIDE ? std::min(1.0, std::max(0.0, e / extent - 0.5)) : 0.5;
    } else if (on != 0 &&
               faces(T, N(i, 0), N(i, 1), N(i, 2), (u - camera(2)) / camera(0), (v - camera(3)) / camera(1))) {
      sums[INLIERS] += 1.0;
      sums[RESIDUAL] += e * e / (within * within);
      if (on == INSIDE) {
        const float f = S(i), g = grey(row, column);
        sums[SHADED] += 1.0;
        sums[SUM_A] += f;
        sums[SUM_B] += g;
        sums[SUM_AA] += f * f;
        sums[SUM_BB] += g * g;
        sums[SUM_AB] += f * g;
      }
    }
  }
  for (int k = 0; k < COUNTS; k++) out(k) += sums[k];
  return count;
}

// The score of a tally of n points; `weights_of` says what the weights are.
inline double rated(View<const double, 1> out, i64 n, View<const double, 1> weights) {
  const double violated = weights(0), hidden = weights(1), residual = weights(2), grey = weights(3);
  const double expected = weights(4), noise = weights(5), m = std::max(out(SHADED), 1.0);
  const double a = out(SUM_A) / m, b = out(SUM_B) / m;
  const double aa = std::max(0.0, out(SUM_AA) / m - a * a), bb = std::max(0.0, out(SUM_BB) / m - b * b);
  const double ab = out(SUM_AB) / m - a * b;
  const double correlated = (ab - expected * std::sqrt(aa * bb)) / std::sqrt((aa + noise) * (bb + noise));
  const double painted = out(SHADED) >= LEAST_SHADED ? grey * correlated : 0.0;
  const double against = residual * out(RESIDUAL) + violated * out(VIOLATIONS) + hidden * out(HIDDEN);
  return (out(INLIERS) * (1.0 + painted) - against) / n;
}

// Fill `out` with what both cameras say of a motion (yaw, x, y, rise); returns how many points were asked.
inline i64 asked(const shape::Arrays &source, const shape::Arrays &target, View<const double, 1> motion, double extent,
                 i64 most, View<double, 1> out) {
  const auto &[P, N, S, Rs, os, depth_s, mask_s, grey_s, camera_s, tolerance_s, inward_s, edges_s] = source;
  const auto &[Q, M, G, Rt, ot, depth_t, mask_t, grey_t, camera_t, tolerance_t, inward_t, edges_t] = target;
  const double c = std::cos(motion(0)), s = std::sin(motion(0));
  Array<double, 2> T(3, 4);
  out.fill(0.0);
  // upright source -> upright target -> target camera: Rt' (turn p + shift + ot)
  for (int k = 0; k < 3; k++) {
    const double a = Rt(0, k), b = Rt(1, k), d = Rt(2, k);
    T(k, 0) = a * c + b * s, T(k, 1) = b * c - a * s, T(k, 2) = d;
    T(k, 3) = a * (motion(1) + ot(0)) + b * (motion(2) + ot(1)) + d * (motion(3) + ot(2));
  }
  const i64 n = tally(P, N, S, most, T, depth_t, mask_t, grey_t, camera_t, tolerance_t, extent, out);
  // and back: Rs' (turn' (q - shift) + os)
  for (int k = 0; k < 3; k++) {
    const double a = Rs(0, k), b = Rs(1, k), d = Rs(2, k);
    T(k, 0) = a * c - b * s, T(k, 1) = a * s + b * c, T(k, 2) = d;
    T(k, 3) = a * os(0) + b * os(1) + d * (os(2) - motion(3)) - T(k, 0) * motion(1) - T(k, 1) * motion(2);
  }
  return n + tally(Q, M, G, most, T, depth_s, mask_s, grey_s, camera_s, tolerance_s, extent, out);
}
inline i64 ask(shape::Arrays source, shape::Arrays target, View<const double, 1> motion, double extent, i64 most,
               View<double, 1> out) {
  return asked(source, target, motion, extent, most, out);
}

// The score of a motion (yaw, x, y, rise), asked of both cameras; the first six `weights` are those of `weights_of`.
inline double two_way(const shape::Arrays &source, const shape::Arrays &target, View<const double, 1> motion,
                      double extent, View<const double, 1> weights, i64 most) {
  Array<double, 1> out(COUNTS);
  const i64 n = asked(source, target, motion, extent, most, out);
  return rated(out, n, weights);
}

// Improve `motion` in place by single `steps (4,)` that raise the score; they halve where none does. Returns the score
// there.
inline double climbed(const shape::Arrays &source, const shape::Arrays &target, View<double, 1> motion, double extent,
                      View<const double, 1> weights, i64 most, View<const double, 1> steps, i64 rounds) {
  double best = two_way(source, target, motion, extent, weights, most), size = 1.0;
  Array<double, 1> trial(4);
  for (i64 round = 0; round < rounds; round++) {
    bool improved = false;
    for (int k = 0; k < 8; k++) {
      const double step = size * steps(k / 2);
      if (step == 0.0) continue;
      std::copy_n(motion.data, 4, trial.data);
      trial(k / 2) += k % 2 == 0 ? step : -step;
      const double found = two_way(source, target, trial, extent, weights, most);
      if (found > best + 0.002) {
        best = found, improved = true;
        std::copy_n(trial.data, 4, motion.data);
      }
    }
    if (!improved) {
      size *= 0.5;
      if (size < 0.12) break;
    }
  }
  return best;
}
inline double climb(shape::Arrays source, shape::Arrays target, View<double, 1> motion, double extent,
                    View<const double, 1> weights, i64 most, View<const double, 1> steps, i64 rounds) {
  return climbed(source, target, motion, extent, weights, most, steps, rounds);
}

inline PyMethodDef METHODS[] = {
    binding::method<tally>("tally", "Add to out (10,) what a silhouette says of the first points; how many those are."),
    binding::method<ask>("ask", "Fill out (10,) with what both cameras say of a motion; how many points were asked."),
    binding::method<climb>("climb", "Improve motion (4,) by steps (4,) that raise the score; the score there."),
    {nullptr, nullptr, 0, nullptr},
};
}  // namespace objreg::silhouette_score
