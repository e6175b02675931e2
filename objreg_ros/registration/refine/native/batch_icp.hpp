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
constexpr i64 BLOCK = projection::BLOCK;
// What is looked up for the points of a block: n of them meet the surface. Each array has its points side by side, so
// that what follows runs for several at a time.
struct Met {
  i64 n;
  u32 index[BLOCK];     // of the points
  double at[3][BLOCK];  // where they are
  float closest[3][BLOCK], facing[3][BLOCK];  // the points closest to them, and their normals
  float own[3][BLOCK];                        // their own normals
};
// What they say: Jacobian of a left step [t r], residual in m, and Tukey's weight, 0 of what is no pair.
struct Errors {
  double J[6][BLOCK], residual[BLOCK], weight[BLOCK];
};
struct Pairs {
  Array<u32, 1> index;
  Array<double, 2> at, J;
  Array<double, 1> residual, weight;
};
struct Sums { i64 count; double weight, squared, spread; };

// Fill `met` with the points from `first` on, at most a block, that T brings to cells that have a closest point.
inline void meet(View<const float, 2> P, View<const float, 2> N, const Surface &to, View<const double, 2> T, i64 first,
                 Met &met) {
  const i64 size = std::min(BLOCK, P.size() - first);
  const projection::Places places = projection::moved(P.cut(first, first + size), T);
  const double rows = to.closest.shape[0], columns = to.closest.shape[1], layers = to.closest.shape[2];
  const double x0 = to.low(0), y0 = to.low(1), z0 = to.low(2), scale = 1.0 / to.cell;
  const double *__restrict xs = places.x.data, *__restrict ys = places.y.data, *__restrict zs = places.z.data;
  const i32 width = static_cast<i32>(to.closest.shape[1]), depth = static_cast<i32>(to.closest.shape[2]);
  const i64 cells = to.closest.shape[0] * to.closest.shape[1] * to.closest.shape[2];
  i32 cell[BLOCK], inside[BLOCK], partner[BLOCK], place[BLOCK];
  i64 n = 0;
  for (i64 k = 0; k < size; k++) {  // several points at a time
    const double a = (xs[k] - x0) * scale, b = (ys[k] - y0) * scale, c = (zs[k] - z0) * scale;
    const bool in = (a >= 0.0) & (b >= 0.0) & (c >= 0.0) & (a < rows) & (b < columns) & (c < layers);
    const i32 row = static_cast<i32>(in ? a : 0.0), column = static_cast<i32>(in ? b : 0.0);
    inside[k] = in;
    cell[k] = (row * width + column) * depth + static_cast<i32>(in ? c : 0.0);  // 0 outside
  }
  for (i64 k = 0; k < size; k++) {
    check(cell[k], cells);
    const u16 j = to.closest.data[cell[k]];
    place[n] = static_cast<i32>(k), partner[n] = j;
    n += inside[k] & (j != closest_points::NO_POINT);
  }
  for (i64 k = 0; k < n; k++) {
    const i64 i = place[k], j = partner[k];
    met.index[k] = static_cast<u32>(first + i);
    met.at[0][k] = xs[i], met.at[1][k] = ys[i], met.at[2][k] = zs[i];
    for (int axis = 0; axis < 3; axis++) {
      met.closest[axis][k] = to.xyz(j, axis), met.facing[axis][k] = to.normals(j, axis);
      met.own[axis][k] = N(first + i, axis);
    }
  }
  met.n = n;
}

// Fill `errors` with those of what met. A pair is within `reach` m, and its normals are compatible. As in projection.py
// everything is looked up first and doubted afterwards.
inline void judge(const Met &met, View<const double, 2> T, double reach, Errors &errors) {
  const double xx = T(0, 0), xy = T(0, 1), xz = T(0, 2), yx = T(1, 0), yy = T(1, 1), yz = T(1, 2);
  const double zx = T(2, 0), zy = T(2, 1), zz = T(2, 2), nearness = 1.0 / (reach * reach);
  auto &[J, residual, weight] = errors;
  for (i64 k = 0; k < met.n; k++) {
    const double a = met.at[0][k], b = met.at[1][k], c = met.at[2][k];
    const double nx = met.facing[0][k], ny = met.facing[1][k], nz = met.facing[2][k];
    const double dx = a - met.closest[0][k], dy = b - met.closest[1][k], dz = c - met.closest[2][k];
    const double facing = (xx * nx + yx * ny + zx * nz) * met.own[0][k] +
                          (xy * nx + yy * ny + zy * nz) * met.own[1][k] +
                          (xz * nx + yz * ny + zz * nz) * met.own[2][k];
    const double near = 1.0 - (dx * dx + dy * dy + dz * dz) * nearness;
    residual[k] = nx * dx + ny * dy + nz * dz;
    weight[k] = (near > 0.0) & (facing >= FACING) ? near * near : 0.0;
    J[0][k] = nx, J[1][k] = ny, J[2][k] = nz;
    J[3][k] = b * nz - c * ny, J[4][k] = c * nx - a * nz, J[5][k] = a * ny - b * nx;
  }
}

// The points P that T brings within `reach` m of the point closest to them, of a normal that is compatible. Their
// indices (n,), where they are (3, n), the Jacobian (6, n) of a left step [t r], the residual (n,) m and Tukey's weight
// (n,).
inline Pairs pair(View<const float, 2> P, View<const float, 2> N, const Surface &to, View<const double, 2> T,
                  double reach) {
  const i64 most = P.size();
  Pairs out{Array<u32, 1>(most), Array<double, 2>(3, most), Array<double, 2>(6, most), Array<double, 1>(most),
            Array<double, 1>(most)};
  Met met;
  Errors errors;
  i64 n = 0;
  for (i64 first = 0; first < most; first += BLOCK) {
    meet(P, N, to, T, first, met), judge(met, T, reach, errors);
    for (i64 k = 0; k < met.n; k++) {
      if (!(errors.weight[k] > 0.0)) continue;
      out.index(n) = met.index[k], out.residual(n) = errors.residual[k], out.weight(n) = errors.weight[k];
      for (int axis = 0; axis < 3; axis++) out.at(axis, n) = met.at[axis][k];
      for (int row = 0; row < 6; row++) out.J(row, n) = errors.J[row][k];
      n++;
    }
  }
  out.index.shape[0] = out.at.shape[1] = out.J.shape[1] = out.residual.shape[0] = out.weight.shape[0] = n;
  return out;
}

// Fill H (6, 6) and g (6,) of the step [t r] at pose T; returns pairs, their weight, error and spread.
inline Sums normal_equations(View<const float, 2> P, View<const float, 2> N, const Surface &to,
                             View<const double, 2> T, double reach, View<double, 2> H, View<double, 1> g) {
  H.fill(0.0), g.fill(0.0);
  double total = 1e-9, squared = 0.0, x = 0.0, y = 0.0, z = 0.0, squares = 0.0;
  i64 count = 0;
  Met met;
  Errors errors;
  for (i64 first = 0; first < P.size(); first += BLOCK) {  // what stays in the processor's first cache
    meet(P, N, to, T, first, met), judge(met, T, reach, errors);
    least_squares::add_block(errors.J, errors.residual, errors.weight, met.n, H, g);
    i64 pairs = 0;
    for (i64 k = 0; k < met.n; k++) {
      const double w = errors.weight[k], a = met.at[0][k], b = met.at[1][k], c = met.at[2][k];
      pairs += w > 0.0;
      total += w;
      squared += w * errors.residual[k] * errors.residual[k];
      x += w * a, y += w * b, z += w * c;
      squares += w * (a * a + b * b + c * c);
    }
    count += pairs;
  }
  const double spread = squares / total - (x * x + y * y + z * z) / (total * total);
  return {count, total, squared, std::max(0.0, spread)};
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
