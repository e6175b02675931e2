// SPDX-License-Identifier: Apache-2.0
// The kernels of flags.py.
#pragma once
#include "objreg_ros/native/binding.hpp"
#include "objreg_ros/segmenter/surface/native/solve_symmetric.hpp"

namespace objreg::flags {
constexpr double LEAK = 0.08;        // an object with more of it outside its box is cut by the box
constexpr double FLAT = 0.85;        // share of a wall-like object's cells on one plane
constexpr double WALL_AROUND = 0.4;  // share of the cells around it on the same plane
constexpr i64 STRIDE = 2;

// a, b, c of the plane 1/z = a x + b y + c through the chosen cells, and its slope √(a² + b² + c²). Least squares of
// inverse depth, of which the noise of structured light is the same at any distance.
inline std::tuple<float, float, float, float> fit_plane(View<const float, 2> depth, View<const float, 1> x,
                                                        View<const float, 1> y, View<const bool, 2> chosen) {
  double m = 0, m_x = 0, m_y = 0, m_xx = 0, m_xy = 0, m_yy = 0, v = 0, v_x = 0, v_y = 0;
  for (i64 i = 0; i < depth.shape[0]; i += STRIDE) {
    const double q = y(i);
    for (i64 j = 0; j < depth.shape[1]; j += STRIDE) {
      if (!(chosen(i, j) && depth(i, j) > 0)) continue;
      const double p = x(j), near = 1 / static_cast<double>(depth(i, j));
      m += 1, m_x += p, m_y += q;
      m_xx += p * p, m_xy += p * q, m_yy += q * q;
      v += near, v_x += near * p, v_y += near * q;
    }
  }
  const double ridge = 1e-12 * m;
  const auto [c, a, b] = support::solve_symmetric({m, m_x, m_y, m_xx + ridge, m_xy, m_yy + ridge}, {v, v_x, v_y});
  const double slope = std::sqrt(a * a + b * b + c * c);
  return {static_cast<float>(a), static_cast<float>(b), static_cast<float>(c), static_cast<float>(slope)};
}

// How many of the chosen cells in the box there are and are flat, and the same of all cells outside it. `tolerance` of
// a plane: m, and its growth.
inline std::array<i64, 4> count_on_plane(View<const float, 2> depth, View<const float, 1> x, View<const float, 1> y,
                                         View<const bool, 2> chosen, std::array<i64, 4> box,
                                         std::tuple<float, float, float, float> plane, std::array<float, 2> tolerance) {
  const auto [a, b, c, slope] = plane;
  i64 own = 0, own_flat = 0, ring = 0, ring_flat = 0;
  for (i64 i = 0; i < depth.shape[0]; i += STRIDE)
    for (i64 j = 0; j < depth.shape[1]; j += STRIDE) {
      const float z = depth(i, j);
      const float off = std::abs(z * (a * x(j) + b * y(i) + c) - 1);
      const bool flat = off < 2.0 * slope * (tolerance[0] + tolerance[1] * z * z);
      if (i < box[1] || i >= box[3] || j < box[0] || j >= box[2]) {
        ring += z > 0;
        ring_flat += (z > 0) & flat;
      } else if (chosen(i, j)) {
        own++;
        own_flat += flat;
      }
    }
  return {own, own_flat, ring, ring_flat};
}

// Whether the box cuts the chosen cells; whether they are flat and their plane goes on around the box. Fewer cells than
// `min_cells` tell no plane.
inline std::tuple<bool, bool> inspect(View<const float, 2> depth, View<const float, 1> x, View<const float, 1> y,
                                      View<const bool, 2> chosen, std::array<i64, 4> box, i64 min_cells,
                                      std::array<float, 2> tolerance) {
  i64 everywhere = 0, inside = 0;
  for (i64 i = 0; i < chosen.shape[0]; i++)
    for (i64 j = 0; j < chosen.shape[1]; j++) everywhere += chosen(i, j);
  for (i64 i = box[1]; i < box[3]; i++)
    for (i64 j = box[0]; j < box[2]; j++) inside += chosen(i, j);
  const bool cut = inside < (1 - LEAK) * everywhere;
  if (inside <= min_cells) return {cut, false};
  const auto plane = fit_plane(depth, x, y, chosen);
  const auto [own, own_flat, ring, ring_flat] = count_on_plane(depth, x, y, chosen, box, plane, tolerance);
  const bool flat = own_flat > FLAT * own;
  const double least_ring = static_cast<double>(min_cells) / (STRIDE * STRIDE);
  return {cut, flat && ring > least_ring && ring_flat > WALL_AROUND * ring};
}

inline PyMethodDef METHODS[] = {
    binding::method<fit_plane>("fit_plane", "a, b, c of the plane 1/z = a x + b y + c, and its slope."),
    binding::method<inspect>("inspect", "Whether the box cuts the cells; whether they are a patch of a wall."),
    {nullptr, nullptr, 0, nullptr},
};
}  // namespace objreg::flags
