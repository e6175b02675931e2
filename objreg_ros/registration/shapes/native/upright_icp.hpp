// SPDX-License-Identifier: Apache-2.0
// The kernels of upright_icp.py.
#pragma once
#include "objreg_ros/native/binding.hpp"
#include "objreg_ros/registration/kernels/native/closest_points.hpp"
#include "objreg_ros/registration/kernels/native/least_squares.hpp"

namespace objreg::upright_icp {
constexpr double COMPATIBLE = 0.5;    // cosine between the normals of a pair
constexpr double LARGEST_TURN = 0.3;  // rad in one step
constexpr double POINTWISE = 0.005;   // weight of point-to-point error beside it: holds what slides along a plane

// `IndexedSurface.grid`: xyz, normals, closest, low and cell.
using Grid = std::tuple<View<const float, 2>, View<const float, 2>, View<const u16, 3>, View<const float, 1>, double>;

// Move `motion (yaw, x, y, rise)` in place, but for its rise, to the surface; returns how many pairs it found. Pairs
// lie within `reach` m at first and `last_reach` at last.
inline i64 settled(View<const float, 2> P, View<const float, 2> N, i64 most, const Grid &surface,
                   View<double, 1> motion, double reach, double last_reach, i64 iterations) {
  const auto &[Q, M, closest, low, cell] = surface;
  const double reach_shrink = last_reach / reach, low_x = low(0), low_y = low(1), low_z = low(2), scale = 1.0 / cell;
  const double columns = closest.shape[0], rows = closest.shape[1], layers = closest.shape[2];
  const i64 n = std::min(most, P.size());
  i64 pairs = 0;
  Array<double, 2> A(3, 3);
  Array<double, 1> g(3);
  for (i64 iteration = 0; iteration < iterations; iteration++) {
    const double share = static_cast<double>(iteration) / static_cast<double>(std::max<i64>(1, iterations - 1));
    const double limit = reach * std::pow(reach_shrink, share), per_limit = 1.0 / (limit * limit);
    const double c = std::cos(motion(0)), s = std::sin(motion(0));
    const double shift_x = motion(1), shift_y = motion(2), rise = motion(3);
    double a00 = 0.0, a01 = 0.0, a02 = 0.0, a11 = 0.0, a12 = 0.0, a22 = 0.0, g0 = 0.0, g1 = 0.0, g2 = 0.0;
    pairs = 0;
    for (i64 i = 0; i < n; i++) {
      const double rx = c * P(i, 0) - s * P(i, 1), ry = s * P(i, 0) + c * P(i, 1);
      const double x = rx + shift_x, y = ry + shift_y, z = P(i, 2) + rise;
      const double a = (x - low_x) * scale, b = (y - low_y) * scale, e = (z - low_z) * scale;
      if (!((a >= 0.0) & (b >= 0.0) & (e >= 0.0) & (a < columns) & (b < rows) & (e < layers))) continue;
      const u16 j = closest(static_cast<i64>(a), static_cast<i64>(b), static_cast<i64>(e));
      if (j == closest_points::NO_POINT) continue;
      const float mx = M(j, 0), my = M(j, 1), mz = M(j, 2);
      if ((c * N(i, 0) - s * N(i, 1)) * mx + (s * N(i, 0) + c * N(i, 1)) * my + N(i, 2) * mz < COMPATIBLE) continue;
      const double dx = x - Q(j, 0), dy = y - Q(j, 1), dz = z - Q(j, 2);
      const double squared = (dx * dx + dy * dy + dz * dz) * per_limit;
      if (squared > 1.0) continue;
      const double w = (1.0 - squared) * (1.0 - squared), v = w * POINTWISE;
      const double r = mx * dx + my * dy + mz * dz, turn = my * rx - mx * ry;
      a00 += w * turn * turn + v * (rx * rx + ry * ry);
      a01 += w * turn * mx - v * ry;
      a02 += w * turn * my + v * rx;
      a11 += w * mx * mx + v;
      a12 += w * mx * my;
      a22 += w * my * my + v;
      g0 += w * turn * r + v * (rx * dy - ry * dx);
      g1 += w * mx * r + v * dx;
      g2 += w * my * r + v * dy;
      pairs++;
    }
    if (pairs < 6) break;
    A(0, 0) = a00 + (1e-6 + 1e-4 * a00), A(0, 1) = A(1, 0) = a01, A(0, 2) = A(2, 0) = a02;
    A(1, 1) = a11 + 1e-3, A(1, 2) = A(2, 1) = a12, A(2, 2) = a22 + 1e-3;
    g(0) = g0, g(1) = g1, g(2) = g2;
    least_squares::solve(A, g);
    motion(0) -= std::min(LARGEST_TURN, std::max(-LARGEST_TURN, g(0)));
    motion(1) -= g(1);
    motion(2) -= g(2);
    if (iteration > 3 && std::abs(g(0)) < 1e-4 && std::abs(g(1)) + std::abs(g(2)) < 2e-5) break;
  }
  return pairs;
}
inline i64 settle(View<const float, 2> P, View<const float, 2> N, i64 most, Grid surface, View<double, 1> motion,
                  double reach, double last_reach, i64 iterations) {
  return settled(P, N, most, surface, motion, reach, last_reach, iterations);
}

inline PyMethodDef METHODS[] = {
    binding::method<settle>("settle", "Move a motion (4,) in place, but for its rise, to the surface; its pairs."),
    {nullptr, nullptr, 0, nullptr},
};
}  // namespace objreg::upright_icp
