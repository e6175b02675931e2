// SPDX-License-Identifier: Apache-2.0
// The kernels of batch_icp.py.
#pragma once
#include "objreg_ros/native/binding.hpp"
#include "objreg_ros/registration/kernels/native/closest_points.hpp"
#include "objreg_ros/registration/kernels/native/least_squares.hpp"
#include "objreg_ros/registration/kernels/native/projection.hpp"

namespace objreg::batch_icp {
constexpr double FACING = 0.6;  // cosine between the normals of a pair, at least

struct Surface {
  View<const float, 2> xyz, normals;
  View<const u16, 3> closest;
  View<const float, 1> low;
  double cell;
};
// `IndexedSurface.grid`
using Grid = std::tuple<View<const float, 2>, View<const float, 2>, View<const u16, 3>, View<const float, 1>, double>;
inline Surface surface_of(const Grid &grid) {
  return std::apply([](auto... part) { return Surface{part...}; }, grid);
}
struct Partners { Array<u32, 1> met, partner; };
struct Pairs {
  Array<u32, 1> index;
  Array<double, 2> at, J;
  Array<double, 1> residual, weight;
};
struct Sums { i64 count; double weight, squared, spread; };

// Which of the places (N,) have a closest point in their cell of the grid, and which that is: (n,) indices each.
inline Partners partners(View<const double, 1> x, View<const double, 1> y, View<const double, 1> z, const Surface &to) {
  Array<u32, 1> met(x.size()), partner(x.size());
  const double rows = to.closest.shape[0], columns = to.closest.shape[1], layers = to.closest.shape[2];
  const double x0 = to.low(0), y0 = to.low(1), z0 = to.low(2), scale = 1.0 / to.cell;
  constexpr i64 BLOCK = projection::BLOCK;
  i32 as[BLOCK], bs[BLOCK], cs[BLOCK];
  i64 inside[BLOCK], n = 0;
  for (i64 first = 0; first < x.size(); first += BLOCK) {
    const i64 size = std::min(BLOCK, x.size() - first);
    const double *__restrict xs = x.data + first, *__restrict ys = y.data + first, *__restrict zs = z.data + first;
    for (i64 k = 0; k < size; k++) {  // several points at a time
      const double a = (xs[k] - x0) * scale, b = (ys[k] - y0) * scale, c = (zs[k] - z0) * scale;
      const bool in = (a >= 0.0) & (b >= 0.0) & (c >= 0.0) & (a < rows) & (b < columns) & (c < layers);
      inside[k] = in;
      as[k] = static_cast<i32>(in ? a : 0.0), bs[k] = static_cast<i32>(in ? b : 0.0);
      cs[k] = static_cast<i32>(in ? c : 0.0);
    }
    for (i64 k = 0; k < size; k++) {
      const u16 j = to.closest(as[k], bs[k], cs[k]);  // of the first cell, for a place that is in none
      const bool known = j != closest_points::NO_POINT;
      met(n) = static_cast<u32>(first + k), partner(n) = known ? j : 0u;
      n += inside[k] & known;
    }
  }
  return {std::move(met).first(n), std::move(partner).first(n)};
}

// The points P that T brings within `reach` m of the point closest to them, of a normal that is compatible. Their
// indices (n,), where they are (3, n), the Jacobian (6, n) of a left step [t r], the residual (n,) m and Tukey's weight
// (n,). As in projection.py everything is looked up first and doubted afterwards.
inline Pairs pair(View<const float, 2> P, View<const float, 2> N, const Surface &to, View<const double, 2> T,
                  double reach) {
  const projection::Places places = projection::moved(P, T);
  Partners found = partners(places.x, places.y, places.z, to);
  const i64 most = found.met.size();
  Pairs out{std::move(found.met), Array<double, 2>(3, most), Array<double, 2>(6, most), Array<double, 1>(most),
            Array<double, 1>(most)};
  const double xx = T(0, 0), xy = T(0, 1), xz = T(0, 2), yx = T(1, 0), yy = T(1, 1), yz = T(1, 2);
  const double zx = T(2, 0), zy = T(2, 1), zz = T(2, 2), nearness = 1.0 / (reach * reach);
  const auto &Q = to.xyz, &M = to.normals;
  i64 n = 0;
  for (i64 k = 0; k < most; k++) {
    const i64 i = out.index(k), j = found.partner(k);
    const double a = places.x(i), b = places.y(i), c = places.z(i);
    const double nx = M(j, 0), ny = M(j, 1), nz = M(j, 2);
    const double dx = a - Q(j, 0), dy = b - Q(j, 1), dz = c - Q(j, 2);
    const double facing = (xx * nx + yx * ny + zx * nz) * N(i, 0) + (xy * nx + yy * ny + zy * nz) * N(i, 1) +
                          (xz * nx + yz * ny + zz * nz) * N(i, 2);
    const double near = 1.0 - (dx * dx + dy * dy + dz * dz) * nearness;
    out.index(n) = static_cast<u32>(i), out.residual(n) = nx * dx + ny * dy + nz * dz, out.weight(n) = near * near;
    out.at(0, n) = a, out.at(1, n) = b, out.at(2, n) = c;
    out.J(0, n) = nx, out.J(1, n) = ny, out.J(2, n) = nz;
    out.J(3, n) = b * nz - c * ny, out.J(4, n) = c * nx - a * nz, out.J(5, n) = a * ny - b * nx;
    n += (near > 0.0) & (facing >= FACING);
  }
  out.index.shape[0] = out.at.shape[1] = out.J.shape[1] = out.residual.shape[0] = out.weight.shape[0] = n;
  return out;
}

// Fill H (6, 6) and g (6,) of the step [t r] at pose T; returns pairs, their weight, error and spread.
inline Sums normal_equations(View<const float, 2> P, View<const float, 2> N, const Surface &to,
                             View<const double, 2> T, double reach, View<double, 2> H, View<double, 1> g) {
  const Pairs pairs = pair(P, N, to, T, reach);
  H.fill(0.0), g.fill(0.0);
  least_squares::add_normal_equations(pairs.J, pairs.residual, pairs.weight, H, g);
  double total = 1e-9, squared = 0.0, x = 0.0, y = 0.0, z = 0.0, squares = 0.0;
  for (i64 k = 0; k < pairs.weight.size(); k++) {
    const double w = pairs.weight(k), a = pairs.at(0, k), b = pairs.at(1, k), c = pairs.at(2, k);
    total += w;
    squared += w * pairs.residual(k) * pairs.residual(k);
    x += w * a, y += w * b, z += w * c;
    squares += w * (a * a + b * b + c * c);
  }
  const double spread = squares / total - (x * x + y * y + z * z) / (total * total);
  return {pairs.weight.size(), total, squared, std::max(0.0, spread)};
}

// Bring `poses` (K, 4, 4) of oriented points to the surface, each to its own basin; returns the share of points with a
// partner within `last_reach` m (K,) and their rmse (K,) m.
inline std::tuple<Array<double, 1>, Array<double, 1>> align(View<const float, 2> P, View<const float, 2> N, Grid grid,
                                                            View<double, 3> poses, double reach, double last_reach,
                                                            i64 iterations) {
  const Surface to = surface_of(grid);
  Array<double, 1> share(poses.size()), rmse(poses.size()), g(6);
  Array<double, 2> H(6, 6);
  const double steps = static_cast<double>(std::max<i64>(1, iterations - 3));
  for (i64 k = 0; k < poses.size(); k++) {
    const View<double, 2> T = poses.row(k);
    for (i64 iteration = 0; iteration < iterations; iteration++) {
      const double now = reach * std::pow(last_reach / reach, iteration / steps);
      const Sums sums = normal_equations(P, N, to, T, std::max(now, last_reach), H, g);
      if (sums.count < 20) break;
      for (int a = 0; a < 6; a++) H(a, a) += 1e-3 + 1e-6 * H(a, a), g(a) = -g(a);
      least_squares::solve(H, g);
      if (least_squares::move(T, g) < 2e-4 && now <= last_reach) break;
    }
    const Sums sums = normal_equations(P, N, to, T, last_reach, H, g);
    share(k) = static_cast<double>(sums.count) / static_cast<double>(P.size());
    rmse(k) = std::sqrt(sums.squared / sums.weight);
  }
  return {std::move(share), std::move(rmse)};
}

// `pair` and `normal_equations` for Python.
inline std::tuple<Array<u32, 1>, Array<double, 2>, Array<double, 2>, Array<double, 1>, Array<double, 1>> pair_with(
    View<const float, 2> P, View<const float, 2> N, View<const float, 2> Q, View<const float, 2> M,
    View<const u16, 3> closest, View<const float, 1> low, double cell, View<const double, 2> T, double reach) {
  Pairs made = pair(P, N, Surface{Q, M, closest, low, cell}, T, reach);
  return {std::move(made.index), std::move(made.at), std::move(made.J), std::move(made.residual),
          std::move(made.weight)};
}
inline std::tuple<i64, double, double, double> fit(View<const float, 2> P, View<const float, 2> N, Grid grid,
                                                   View<const double, 2> T, double reach, View<double, 2> H) {
  Array<double, 1> g(6);
  const Sums sums = normal_equations(P, N, surface_of(grid), T, reach, H, g);
  return {sums.count, sums.weight, sums.squared, sums.spread};
}

inline PyMethodDef METHODS[] = {
    binding::method<align>("align", "Moves poses to their basins; their share of partners and their rmse."),
    binding::method<fit>("fit", "Fills H (6, 6) at a pose; the number of pairs, their weight, error and spread."),
    binding::method<pair_with>("pair", "The pairs: index, where, Jacobian, residual and weight."),
    {nullptr, nullptr, 0, nullptr},
};
}  // namespace objreg::batch_icp
