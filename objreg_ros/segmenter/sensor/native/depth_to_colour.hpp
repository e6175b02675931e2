// SPDX-License-Identifier: Apache-2.0
// The kernels of depth_to_colour.py.
#pragma once
#include "objreg_ros/native/binding.hpp"

namespace objreg::depth_to_colour {
constexpr i64 SHADOW = 3;           // px: the depth behind a step may be missing for as far
constexpr float LEAST_AWAY = 0.1f;  // m before the camera, of a ray that is 1 m long along the other's axis

using Camera = std::array<double, 4>;  // fx, fy, cx, cy
using Turn = std::array<double, 3>;    // rad

inline Turn read(View<const double, 1> of) { return {of(0), of(1), of(2)}; }
inline Array<double, 1> given(const Turn &turn) {
  Array<double, 1> out(3);
  std::copy_n(turn.data(), 3, out.data);
  return out;
}

// Add where measured depths step that follow each other along a line, SHADOW apart at most; returns how many. The line
// has `size` depths, each `stride` after the last.
inline i64 steps_along(const float *line, i64 size, i64 stride, View<double, 2> at, i64 n, i64 axis, float base,
                       float growth) {
  i64 last = -1;
  float before = 0.0f;
  for (i64 k = 0; k < size; k++) {
    const float z = line[k * stride];
    if (z <= 0.0f) continue;
    if (last >= 0 && k - last <= SHADOW) {
      const float off = z - before, closer = std::min(z, before);
      if (std::abs(off) > static_cast<double>(base + growth * closer * closer) * (k - last)) {
        at(n, axis) = off > 0.0f ? last + 0.5 : k - 0.5;
        n++;
      }
    }
    last = k, before = z;
  }
  return n;
}

// The rays (N, 2), x and y at z = 1, of the depth steps along rows and columns, half a pixel off the near side.
inline Array<double, 2> steps(View<const float, 2> depth, double fx, double fy, double cx, double cy, float base,
                              float growth) {
  const i64 height = depth.shape[0], width = depth.shape[1];
  Array<double, 2> at(2 * height * width, 2);
  i64 n = 0;
  for (i64 row = 2; row < height - 2; row++) {
    const i64 first = n;
    n = steps_along(depth.row(row).data, width, 1, at, n, 0, base, growth);
    for (i64 k = first; k < n; k++) at(k, 1) = row;
  }
  for (i64 column = 2; column < width - 2; column++) {
    const i64 first = n;
    n = steps_along(depth.data + column, height, depth.stride[0], at, n, 1, base, growth);
    for (i64 k = first; k < n; k++) at(k, 0) = column;
  }
  for (i64 k = 0; k < n; k++) at(k, 0) = (at(k, 0) - cx) / fx, at(k, 1) = (at(k, 1) - cy) / fy;
  return std::move(at).first(n);
}

// The mean strength of the gradients where turned rays land, less what the prior says against the rotation.
inline double score_of(View<const double, 2> rays, View<const float, 2> picture, const Camera &camera, const Turn &mean,
                       const Turn &weight, const Turn &rotation) {
  const auto [fx, fy, cx, cy] = camera;
  const auto [a, b, c] = rotation;
  const double last_row = picture.shape[0] - 1.0, last_column = picture.shape[1] - 1.0;
  constexpr i64 MOST = 256;  // rays at a time: where they land first, without branches, for the vectors
  double u_of[MOST], v_of[MOST], total = 0.0;
  for (i64 first = 0; first < rays.size(); first += MOST) {
    const i64 size = std::min(rays.size() - first, MOST);
    const double *__restrict ray = rays.cut(first, first + size).data;
    for (i64 k = 0; k < size; k++) {
      const double x = ray[k * rays.stride[0]], y = ray[k * rays.stride[0] + 1];
      const double near = 1.0 / (1.0 + a * y - b * x);
      const double u = fx * (x + b - c * y) * near + cx, v = fy * (y + c * x - a) * near + cy;
      const bool seen = (u >= 0.0) & (v >= 0.0) & (u < last_column) & (v < last_row);
      u_of[k] = u, v_of[k] = seen ? v : -1.0;
    }
    for (i64 k = 0; k < size; k++) {
      if (v_of[k] < 0.0) continue;
      const i64 left = static_cast<i64>(u_of[k]), top = static_cast<i64>(v_of[k]);
      const double p = u_of[k] - left, q = v_of[k] - top;
      const double upper = (1.0 - p) * picture(top, left) + p * picture(top, left + 1);
      const double lower = (1.0 - p) * picture(top + 1, left) + p * picture(top + 1, left + 1);
      total += (1.0 - q) * upper + q * lower;
    }
  }
  double against = 0.0;
  for (int k = 0; k < 3; k++) {
    const double away = (rotation[k] - mean[k]) * weight[k];
    against += away * away;
  }
  return total / rays.size() - 0.5 * against;
}

inline double score(View<const double, 2> rays, View<const float, 2> picture, Camera camera, View<const double, 1> mean,
                    View<const double, 1> weight, View<const double, 1> rotation) {
  return score_of(rays, picture, camera, read(mean), read(weight), read(rotation));
}

// The best rotation (3,) of a grid about the mean, `across` about x and y, `around` about z.
inline Array<double, 1> coarse(View<const double, 2> rays, View<const float, 2> picture, Camera camera,
                               View<const double, 1> mean, View<const double, 1> weight, View<const double, 1> across,
                               View<const double, 1> around) {
  const Turn middle = read(mean), by = read(weight);
  Turn chosen = middle;
  double best = -std::numeric_limits<double>::infinity();
  for (i64 i = 0; i < across.size(); i++)
    for (i64 j = 0; j < across.size(); j++)
      for (i64 k = 0; k < around.size(); k++) {
        const Turn trial{middle[0] + across(i), middle[1] + across(j), middle[2] + around(k)};
        const double found = score_of(rays, picture, camera, middle, by, trial);
        if (found > best) best = found, chosen = trial;
      }
  return given(chosen);
}

// A rotation brought to where the score is highest, an axis at a time.
inline Array<double, 1> climbed(View<const double, 2> rays, View<const float, 2> picture, Camera camera,
                                View<const double, 1> mean, View<const double, 1> weight, View<const double, 1> start,
                                View<const double, 1> sizes, i64 rounds) {
  const Turn middle = read(mean), by = read(weight);
  Turn rotation = read(start);
  double best = score_of(rays, picture, camera, middle, by, rotation);
  for (i64 s = 0; s < sizes.size(); s++) {
    bool improved = true;
    for (i64 round = 0; round < rounds && improved; round++) {
      improved = false;
      for (int k = 0; k < 6; k++) {
        Turn trial = rotation;
        trial[k / 2] += k % 2 == 0 ? sizes(s) : -sizes(s);
        const double found = score_of(rays, picture, camera, middle, by, trial);
        if (found > best) best = found, improved = true, rotation = trial;
      }
    }
  }
  return given(rotation);
}

// Depth (H, W) as a camera sees it from which the depth camera is turned away; the nearest pixel's, 0 beyond and for
// more than `most`. In float32: a ten-thousandth of a pixel.
inline Array<float, 2> turned(View<const float, 2> depth, Camera camera, View<const double, 1> rotation, double most) {
  const i64 height = depth.shape[0], width = depth.shape[1];
  const float fx = float(camera[0]), fy = float(camera[1]), cx = float(camera[2]), cy = float(camera[3]);
  const float a = float(rotation(0)), b = float(rotation(1)), c = float(rotation(2)), farthest = float(most);
  const float right = width - 0.5f, bottom = height - 0.5f;
  Array<float, 2> out(height, width);
  Array<float, 1> nears(width), slopes(width);
  Array<i32, 1> places(width);
  float *__restrict nearness = nears.data;
  float *__restrict slope = slopes.data;
  i32 *__restrict place = places.data;
  const i32 columns = static_cast<i32>(width), rows_apart = static_cast<i32>(depth.stride[0]);
  for (i32 column = 0; column < columns; column++) slope[column] = (float(column) - cx) / fx;
  for (i64 row = 0; row < height; row++) {
    const float y = (float(row) - cy) / fy;
    for (i32 column = 0; column < columns; column++) {  // without branches, for the vectors
      const float x = slope[column];
      const float away = 1.0f - a * y + b * x;  // the rotation back, of a ray of the colour camera
      const float near = 1.0f / (away > LEAST_AWAY ? away : 1.0f);
      const float u = fx * (x - b + c * y) * near + cx, v = fy * (y - c * x + a) * near + cy;
      const bool seen = (away > LEAST_AWAY) & (u > -0.5f) & (v > -0.5f) & (u < right) & (v < bottom);
      nearness[column] = seen ? near : 0.0f;
      const float from_row = seen ? v + 0.5f : 0.0f, from_column = seen ? u + 0.5f : 0.0f;
      place[column] = static_cast<i32>(from_row) * rows_apart + static_cast<i32>(from_column);
    }
    const float *__restrict from = depth.data;
    float *__restrict to = out.row(row).data;
    for (i32 column = 0; column < columns; column++) {
      check(place[column] / rows_apart, height);
      const float z = from[place[column]] * nearness[column];
      to[column] = z <= farthest ? z : 0.0f;
    }
  }
  return out;
}

inline PyMethodDef METHODS[] = {
    binding::method<steps>("steps", "The rays of the depth steps along rows and columns."),
    binding::method<score>("score", "The mean strength of the gradients where turned rays land."),
    binding::method<coarse>("coarse", "The best rotation of a grid about the mean."),
    binding::method<climbed>("climbed", "A rotation brought to where the score is highest."),
    binding::method<turned>("turned", "Depth as the colour camera sees it."),
    {nullptr, nullptr, 0, nullptr},
};
}  // namespace objreg::depth_to_colour
