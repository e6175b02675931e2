// SPDX-License-Identifier: Apache-2.0
// The kernels of visual_hull.py.
#pragma once
#include "objreg_ros/native/binding.hpp"
#include "objreg_ros/registration/kernels/native/least_squares.hpp"
#include "objreg_ros/registration/shapes/native/silhouette_score.hpp"

namespace objreg::visual_hull {
using silhouette::BESIDE, silhouette::INSIDE, silhouette_score::tolerance_at;

constexpr double LARGEST_TURN = 0.3, LARGEST_SHIFT = 0.15;  // rad and m in one step
constexpr double KNEE = 0.02;   // m: a point that floats farther pulls no harder: what one camera missed does not tear
constexpr double BEFORE = 0.2;  // weight of a point before the surface: it may as well belong beside it
constexpr double DAMPING[] = {1.5, 30.0, 30.0};  // of yaw and the shifts: a few points that float move the shape little

struct Seen {  // by a camera, of `Shape.kernel_arrays`
  View<const float, 2> depth;
  View<const u8, 2> mask;
  View<const double, 1> camera, tolerance;
  View<const silhouette::i16, 3> inward;
  View<const bool, 1> edges;
  explicit Seen(const shape::Arrays &of)
      : depth(std::get<5>(of)), mask(std::get<6>(of)), camera(std::get<8>(of)), tolerance(std::get<9>(of)),
        inward(std::get<10>(of)), edges(std::get<11>(of)) {}
};

// Camera from points: a turn, a shift, and how the camera sees the two shifts of a motion.
struct Sight {
  double R[3][3], t[3], level[3][2];
};

// Add to the normal equations (A, g) of (yaw, x, y) what heals the points that float; returns how far they do. `lever`
// (c, s, x, y): yaw moves a point by its level place, turned by (c, s) and less (x, y).
inline double pushes(View<const float, 2> P, i64 most, const Sight &sight, const Seen &seen,
                     const std::array<double, 4> &lever, View<double, 2> A, View<double, 1> g) {
  const auto &[R, t, level] = sight;
  const double fx = seen.camera(0), fy = seen.camera(1), cx = seen.camera(2), cy = seen.camera(3);
  const double most_u = seen.depth.shape[1] - 1.0, most_v = seen.depth.shape[0] - 1.0;
  const i64 count = std::min(most, P.size());
  const double per_pixel = 2.0 / (fx + fy);
  const bool left_end = seen.edges(0), top_end = seen.edges(1), right_end = seen.edges(2), low_end = seen.edges(3);
  double a00 = 0.0, a01 = 0.0, a02 = 0.0, a11 = 0.0, a12 = 0.0, a22 = 0.0, g0 = 0.0, g1 = 0.0, g2 = 0.0, total = 0.0;
  for (i64 i = 0; i < count; i++) {
    const double a = P(i, 0), b = P(i, 1), c = P(i, 2);
    const double z = R[2][0] * a + R[2][1] * b + R[2][2] * c + t[2];
    if (!(z >= 0.1)) continue;
    const double x = (R[0][0] * a + R[0][1] * b + R[0][2] * c + t[0]) / z;
    const double y = (R[1][0] * a + R[1][1] * b + R[1][2] * c + t[1]) / z;
    const double u = fx * x + cx, v = fy * y + cy;
    const double at_u = std::min(std::max(0.0, u), most_u), at_v = std::min(std::max(0.0, v), most_v);
    double du = at_u - u, dv = at_v - v;
    if ((du > 0.0 && left_end) || (dv > 0.0 && top_end) || (du < -1.0 && right_end) || (dv < -1.0 && low_end))
      continue;  // beyond the picture
    const i64 row = static_cast<i64>(at_v), column = static_cast<i64>(at_u);
    const u8 on = seen.mask(row, column);
    const double d = seen.depth(row, column);
    const bool beyond = std::abs(du) + std::abs(dv) > 1.0;
    double far, nx = 0.0, ny = 0.0, nz = 1.0;
    if (on == INSIDE && !beyond) {  // before the surface?
      far = d - z;
      if (far < tolerance_at(z, seen.tolerance)) continue;
    } else {  // beside the outline, and not behind what is seen there?
      if ((on != BESIDE && !beyond) || (d > 0.0 && z - d > tolerance_at(z, seen.tolerance))) continue;
      du += seen.inward(row, column, 0), dv += seen.inward(row, column, 1);
      const double pixels = std::sqrt(du * du + dv * dv) + 1e-9;
      far = pixels * z * per_pixel;
      nx = fx * per_pixel / pixels * du, ny = fy * per_pixel / pixels * dv;
      nz = -nx * x - ny * y;
    }
    const double along_x = nx * level[0][0] + ny * level[1][0] + nz * level[2][0];
    const double along_y = nx * level[0][1] + ny * level[1][1] + nz * level[2][1];
    const double left = lever[0] * a - lever[1] * b - lever[2], ahead = lever[1] * a + lever[0] * b - lever[3];
    const double turn = left * along_y - ahead * along_x;
    const double weight = (on == INSIDE && !beyond ? BEFORE : 1.0) / std::max(far, KNEE);
    a00 += weight * turn * turn, a01 += weight * turn * along_x, a02 += weight * turn * along_y;
    a11 += weight * along_x * along_x, a12 += weight * along_x * along_y, a22 += weight * along_y * along_y;
    g0 -= weight * turn * far, g1 -= weight * along_x * far, g2 -= weight * along_y * far;
    total += far;
  }
  A(0, 0) += a00, A(0, 1) += a01, A(0, 2) += a02, A(1, 1) += a11, A(1, 2) += a12, A(2, 2) += a22;
  g(0) += g0, g(1) += g1, g(2) += g2;
  return total;
}

// Move `motion` by the damped step of its normal equations; whether it moved enough to go on.
inline bool step(View<double, 2> A, View<double, 1> g, View<double, 1> motion) {
  A(1, 0) = A(0, 1), A(2, 0) = A(0, 2), A(2, 1) = A(1, 2);
  for (int k = 0; k < 3; k++) A(k, k) += DAMPING[k];
  least_squares::solve(A, g);
  motion(0) -= std::min(LARGEST_TURN, std::max(-LARGEST_TURN, g(0)));
  motion(1) -= std::min(LARGEST_SHIFT, std::max(-LARGEST_SHIFT, g(1)));
  motion(2) -= std::min(LARGEST_SHIFT, std::max(-LARGEST_SHIFT, g(2)));
  return std::abs(g(0)) > 1e-3 || std::abs(g(1)) + std::abs(g(2)) > 1e-3;
}

// Move `motion (yaw, x, y, rise)` in place, but for its rise, to where the first `most` points float least. Returns by
// how many metres, all together, they float there.
inline double cleared(const shape::Arrays &source, const shape::Arrays &target, View<double, 1> motion, i64 most,
                      i64 rounds) {
  const auto P = std::get<0>(source), Q = std::get<0>(target);
  const auto Rs = std::get<3>(source), Rt = std::get<3>(target);
  const auto os = std::get<4>(source), ot = std::get<4>(target);
  const Seen seen_s(source), seen_t(target);
  Sight sight;
  auto &[R, t, level] = sight;
  Array<double, 2> A(3, 3);
  Array<double, 1> g(3);
  double best = 1e9, kept[4];
  std::copy_n(motion.data, 4, kept);
  for (i64 iteration = 0; iteration <= rounds; iteration++) {
    const double c = std::cos(motion(0)), s = std::sin(motion(0));
    A.fill(0.0), g.fill(0.0);
    // upright source -> upright target -> target camera: Rt' (turn p + shift + ot)
    for (int k = 0; k < 3; k++) {
      const double a = Rt(0, k), b = Rt(1, k), d = Rt(2, k);
      R[k][0] = a * c + b * s, R[k][1] = b * c - a * s, R[k][2] = d;
      t[k] = a * (motion(1) + ot(0)) + b * (motion(2) + ot(1)) + d * (motion(3) + ot(2));
      level[k][0] = a, level[k][1] = b;
    }
    double floating = pushes(P, most, sight, seen_t, {c, s, 0.0, 0.0}, A, g);
    // and back: Rs' (turn' (q - shift) + os)
    for (int k = 0; k < 3; k++) {
      const double a = Rs(0, k), b = Rs(1, k), d = Rs(2, k);
      R[k][0] = a * c - b * s, R[k][1] = a * s + b * c, R[k][2] = d;
      t[k] = a * os(0) + b * os(1) + d * (os(2) - motion(3)) - R[k][0] * motion(1) - R[k][1] * motion(2);
      level[k][0] = -R[k][0], level[k][1] = -R[k][1];
    }
    floating += pushes(Q, most, sight, seen_s, {1.0, 0.0, motion(1), motion(2)}, A, g);
    if (floating < best) {
      best = floating;
      std::copy_n(motion.data, 4, kept);
    }
    if (iteration == rounds || !step(A, g, motion)) break;
  }
  std::copy_n(kept, 4, motion.data);
  return best;
}
inline double clear(shape::Arrays source, shape::Arrays target, View<double, 1> motion, i64 most, i64 rounds) {
  return cleared(source, target, motion, most, rounds);
}

inline PyMethodDef METHODS[] = {
    binding::method<clear>("clear", "Move a motion (4,) in place to where the points float least; by how many metres."),
    {nullptr, nullptr, 0, nullptr},
};
}  // namespace objreg::visual_hull
