// SPDX-License-Identifier: Apache-2.0
// The kernels of raster.py.
#pragma once
#include "objreg_ros/native/binding.hpp"

// Sums in the order written: a recording is the same on every processor.
#pragma GCC push_options
#pragma GCC optimize("no-associative-math", "no-reciprocal-math", "fp-contract=off")

namespace objreg::raster {
constexpr double NEAR_M = 0.02;
constexpr double EDGE_SLACK_PX = 1e-3;  // triangles are filled this much beyond their edges: rounding leaves no cracks

// Pixel bounds (x0, y0, x1, y1) of the part of triangle P (3, 3) beyond the near plane; false if there is none.
inline bool bounds_of(const double (&P)[3][3], const std::array<double, 4> &camera, double (&out)[4]) {
  const auto [fx, fy, cx, cy] = camera;
  bool found = false;
  for (int i = 0; i < 3; i++) {
    const int j = (i + 1) % 3;
    for (int end = 0; end < 2; end++) {
      double z = P[i][2], x = P[i][0], y = P[i][1];
      if (end == 1) {  // where the edge i-j crosses the near plane
        if ((P[i][2] > NEAR_M) == (P[j][2] > NEAR_M)) continue;
        const double s = (NEAR_M - P[i][2]) / (P[j][2] - P[i][2]);
        z = NEAR_M, x = P[i][0] + s * (P[j][0] - P[i][0]), y = P[i][1] + s * (P[j][1] - P[i][1]);
      }
      if (z < NEAR_M) continue;
      const double u = fx * x / z + cx, v = fy * y / z + cy;
      if (!found) out[0] = u, out[1] = v, out[2] = u, out[3] = v;
      out[0] = std::min(out[0], u), out[1] = std::min(out[1], v);
      out[2] = std::max(out[2], u), out[3] = std::max(out[3], v);
      found = true;
    }
  }
  return found;
}

// Bounds and edge functions of all faces; `vertices` are in the camera frame. `edges` (F, 3, 3) and `inverse_depth`
// (F, 3) hold value at the bounds' first pixel, slope in u, slope in v. Bounds with x1 < x0: nothing is to be drawn.
inline void set_up(View<const double, 2> vertices, View<const i32, 2> faces, View<const bool, 1> open_surface,
                   std::array<double, 4> camera, i64 width, i64 height, View<i32, 2> bounds, View<float, 3> edges,
                   View<float, 2> inverse_depth) {
  const auto [fx, fy, cx, cy] = camera;
  double P[3][3], W[3][3], box[4];
  for (i64 f = 0; f < faces.size(); f++) {
    bounds(f, 0) = 1, bounds(f, 2) = 0;
    for (int i = 0; i < 3; i++)
      for (int k = 0; k < 3; k++) P[i][k] = vertices(faces(f, i), k);
    if (P[0][2] < NEAR_M && P[1][2] < NEAR_M && P[2][2] < NEAR_M) continue;
    for (int i = 0; i < 3; i++) {
      const int a = (i + 1) % 3, b = (i + 2) % 3;
      W[i][0] = P[a][1] * P[b][2] - P[a][2] * P[b][1];
      W[i][1] = P[a][2] * P[b][0] - P[a][0] * P[b][2];
      W[i][2] = P[a][0] * P[b][1] - P[a][1] * P[b][0];
    }
    const double det = P[0][0] * W[0][0] + P[0][1] * W[0][1] + P[0][2] * W[0][2];
    if (std::abs(det) < 1e-14 || (det > 0.0 && !open_surface(f))) continue;
    if (!bounds_of(P, camera, box)) continue;
    const double x0 = std::max(0.0, std::ceil(box[0] - EDGE_SLACK_PX));
    const double y0 = std::max(0.0, std::ceil(box[1] - EDGE_SLACK_PX));
    const double x1 = std::min(width - 1.0, std::floor(box[2] + EDGE_SLACK_PX));
    const double y1 = std::min(height - 1.0, std::floor(box[3] + EDGE_SLACK_PX));
    if (x1 < x0 || y1 < y0) continue;
    bounds(f, 0) = static_cast<i32>(x0), bounds(f, 1) = static_cast<i32>(y0);
    bounds(f, 2) = static_cast<i32>(x1), bounds(f, 3) = static_cast<i32>(y1);
    double s0 = 0.0, s1 = 0.0, s2 = 0.0;
    for (int i = 0; i < 3; i++) {
      const double du = W[i][0] / fx / det, dv = W[i][1] / fy / det;
      const double value = W[i][2] / det + du * (x0 - cx) + dv * (y0 - cy);
      edges(f, i, 0) = static_cast<float>(value);
      edges(f, i, 1) = static_cast<float>(du), edges(f, i, 2) = static_cast<float>(dv);
      s0 += value, s1 += du, s2 += dv;
    }
    inverse_depth(f, 0) = static_cast<float>(s0);
    inverse_depth(f, 1) = static_cast<float>(s1), inverse_depth(f, 2) = static_cast<float>(s2);
  }
}
#pragma GCC pop_options

// Draw all faces into the rows y_first..y_last of `nearness` (1/z, 0 for nothing) and `triangle`.
inline void fill(View<const i32, 2> bounds, View<const float, 3> edges, View<const float, 2> inverse_depth, i64 y_first,
                 i64 y_last, View<float, 2> nearness, View<i32, 2> triangle) {
  constexpr float slack = EDGE_SLACK_PX, nearest = 1.0 / NEAR_M;
  for (i64 f = 0; f < bounds.size(); f++) {
    const i64 x0 = bounds(f, 0), x1 = bounds(f, 2);
    if (x1 < x0 || bounds(f, 1) >= y_last || bounds(f, 3) < y_first) continue;
    const i64 y0 = bounds(f, 1), last = std::min<i64>(bounds(f, 3) + 1, y_last);
    const float slope = inverse_depth(f, 1);
    for (i64 y = std::max(y0, y_first); y < last; y++) {
      const float dy = static_cast<float>(y - y0);
      float lo = 0.0f, hi = static_cast<float>(x1 - x0);
      for (int i = 0; i < 3; i++) {
        const float value = edges(f, i, 0) + edges(f, i, 2) * dy, a = edges(f, i, 1);
        if (a > 0.0f) lo = std::max(lo, -value / a - slack);
        else if (a < 0.0f) hi = std::min(hi, -value / a + slack);
        else if (value < 0.0f) hi = -1.0f;
      }
      if (lo > hi) continue;
      const float row = inverse_depth(f, 0) + inverse_depth(f, 2) * dy;
      const int start = static_cast<int>(std::ceil(lo)), stop = static_cast<int>(std::floor(hi)) + 1;
      float *__restrict near_row = &nearness(y, x0);
      i32 *__restrict faces_row = &triangle(y, x0);
      for (int x = start; x < stop; x++) {
        const float near = row + slope * static_cast<float>(x);
        const bool drawn = near > near_row[x] && near < nearest;
        near_row[x] = drawn ? near : near_row[x];
        faces_row[x] = drawn ? static_cast<i32>(f) : faces_row[x];
      }
    }
  }
}

inline PyMethodDef METHODS[] = {
    binding::method<set_up>("set_up", "Bounds and edge functions of all faces."),
    binding::method<fill>("fill", "Draw all faces into rows of an image."),
    {nullptr, nullptr, 0, nullptr},
};
}  // namespace objreg::raster
