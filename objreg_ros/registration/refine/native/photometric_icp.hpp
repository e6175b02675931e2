// SPDX-License-Identifier: Apache-2.0
// The kernels of photometric_icp.py.
#pragma once
#include "objreg_ros/registration/refine/native/batch_icp.hpp"
#include "objreg_ros/registration/score/native/free_space.hpp"

namespace objreg::photometric_icp {
using free_space::Image;
using Asked = std::tuple<View<const float, 2>, View<const float, 1>>;  // points and their shades
constexpr int STEPS = 8;          // a level
constexpr double SETTLED = 2e-4;  // length of a last step, metres and radians

// Which of the projected points the image meets within twice the tolerance, on a surface of both: (n,) indices.
inline Array<u32, 1> meeting(const projection::Places &at, View<const float, 1> shades, const Image &image,
                             std::array<double, 2> slops) {
  const auto &[near, far, detail, camera] = image;
  const double base = 2.0 * slops[0], growth = 2.0 * slops[1];
  Array<u32, 1> met = projection::visible(at.x, at.y, at.z, near, far, base, growth);
  i64 n = 0;
  for (i64 k = 0; k < met.size(); k++) {
    const u32 i = met(k);
    const projection::Pixel pixel = projection::nearest(at.x(i), at.y(i));
    const double slop = base + growth * at.z(i) * at.z(i);
    met(n) = i;
    n += (far(pixel.row, pixel.column) - near(pixel.row, pixel.column) <= slop) & (shades(i) < free_space::SHADELESS);
  }
  return std::move(met).first(n);
}

// Add the errors of grey of `asked` points, moved by `T` into `image`; to be stepped is T_target_source. Backwards the
// points are the target's: a step moves the source's image the other way under them.
inline void add_grey(Asked asked, View<const double, 2> T, Image image, View<const double, 2> T_target_source,
                     bool backwards, double sigma, std::array<double, 2> slops, View<double, 2> H, View<double, 1> g) {
  const auto &[points, shades] = asked;
  const auto &[near, far, detail, camera] = image;
  const auto [fx, fy, cx, cy] = camera;
  const View<const double, 2> R = T_target_source;
  constexpr i64 BLOCK = projection::BLOCK;
  double at_u[BLOCK], at_v[BLOCK], depths[BLOCK], slope_u[BLOCK], slope_v[BLOCK], own[3][BLOCK];
  double J[6][BLOCK], error[BLOCK], weight[BLOCK];
  for (i64 first = 0; first < points.size(); first += BLOCK) {  // what stays in the processor's first cache
    const i64 end = std::min(first + BLOCK, points.size());
    const auto some = points.cut(first, end);
    const auto own_shades = shades.cut(first, end);
    const projection::Places at = projection::project(some, T, camera);
    const Array<u32, 1> met = meeting(at, own_shades, image, slops);
    const i64 n = met.size();
    for (i64 k = 0; k < n; k++) {
      const u32 i = met(k);
      at_u[k] = at.x(i), at_v[k] = at.y(i), depths[k] = at.z(i);
      const auto [shade, du, dv] = projection::between(detail, at_u[k], at_v[k]);
      error[k] = shade - own_shades(i), slope_u[k] = du, slope_v[k] = dv;
      for (int axis = 0; axis < 3; axis++) own[axis][k] = some(i, axis);
    }
    for (i64 k = 0; k < n; k++) {  // several points at a time
      const double u = at_u[k] - cx, v = at_v[k] - cy, depth = depths[k];
      error[k] /= sigma;
      const double softened = 1.0 + error[k] * error[k];
      weight[k] = 1.0 / (softened * softened);
      const double nearness = 1.0 / (depth * sigma);
      double a = slope_u[k] * fx * nearness, b = slope_v[k] * fy * nearness;
      double c = -(slope_u[k] * u + slope_v[k] * v) * nearness;
      double x = u / fx * depth, y = v / fy * depth, z = depth;
      if (backwards) {
        const double p = -a, q = -b, r = -c;
        a = R(0, 0) * p + R(0, 1) * q + R(0, 2) * r;
        b = R(1, 0) * p + R(1, 1) * q + R(1, 2) * r;
        c = R(2, 0) * p + R(2, 1) * q + R(2, 2) * r;
        x = own[0][k], y = own[1][k], z = own[2][k];
      }
      J[0][k] = a, J[1][k] = b, J[2][k] = c;
      J[3][k] = y * c - z * b, J[4][k] = z * a - x * c, J[5][k] = x * b - y * a;
    }
    least_squares::add_block(J, error, weight, n, H, g);
  }
}

// Gauss-Newton on one band: moves `T` (4, 4) and fills `K` (6, 6), the information of the grey.
inline void finish(std::tuple<View<const float, 2>, View<const float, 2>> shape, batch_icp::Grid grid,
                   View<double, 2> T, double reach, Asked own, Image image, Asked others, Image other_image,
                   double grey_sigma, double shape_sigma, std::array<double, 2> slops, View<double, 2> K) {
  const auto &[P, N] = shape;
  const batch_icp::Surface to = batch_icp::surface_of(grid);
  Array<double, 2> H(6, 6), back(4, 4);
  Array<double, 1> g(6), k(6);
  const double variance = shape_sigma * shape_sigma;
  for (int step = 0; step < STEPS; step++) {
    batch_icp::normal_equations(P, N, to, T, reach, H, g);
    K.fill(0.0), k.fill(0.0);
    add_grey(own, T, other_image, T, false, grey_sigma, slops, K, k);
    least_squares::invert(T, back);
    add_grey(others, back, image, T, true, grey_sigma, slops, K, k);
    for (int i = 0; i < 6; i++) {
      for (int j = 0; j < 6; j++) H(i, j) = H(i, j) / variance + K(i, j);
      H(i, i) += 1.0 + 1e-6 * H(i, i);
      k(i) = -(g(i) / variance + k(i));
    }
    least_squares::solve(H, k);
    if (least_squares::move(T, k) < SETTLED) break;
  }
}

inline PyMethodDef METHODS[] = {
    binding::method<add_grey>("add_grey", "Adds the errors of grey of points in an image to H (6, 6) and g (6,)."),
    binding::method<finish>("finish", "Moves T (4, 4) on one band and fills K (6, 6)."),
    {nullptr, nullptr, 0, nullptr},
};
}  // namespace objreg::photometric_icp
