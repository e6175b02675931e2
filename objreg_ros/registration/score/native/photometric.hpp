// SPDX-License-Identifier: Apache-2.0
// The kernels of photometric.py.
#pragma once
#include "objreg_ros/registration/score/native/free_space.hpp"

namespace objreg::photometric {
constexpr double CONTRAST = 3.0;  // grey levels that are added to the contrast of a window: sensor noise is no print
constexpr float COVERED = 0.1f;   // weight of the points about a pixel from which on it has a grey
constexpr int LAYERS = 5;         // that are summed in a window: where there is grey, either grey, and its square

struct Greys { Array<float, 2> both, theirs, ours; };

// The grey of `points` moved by `T` where an image agrees with their depth, spread over four pixels each: (h, w, 2),
// the sums of grey and of weights.
inline Array<float, 3> laid(View<const float, 2> points, View<const float, 1> greys, View<const double, 2> T,
                            View<const float, 2> near, View<const float, 2> far, free_space::Camera camera,
                            std::array<double, 2> slops) {
  auto out = zeros<float, 3>(near.shape[0], near.shape[1], i64{2});
  const projection::Places at = projection::project(points, T, camera);
  const Array<u32, 1> seen = projection::visible(at.x, at.y, at.z, near, far, slops[0], slops[1]);
  for (i64 k = 0; k < seen.size(); k++) projection::spread(out, at.x(seen(k)), at.y(seen(k)), greys(seen(k)));
  return out;
}

// Where both have a grey, 1 or 0 (h, w); and their greys there, 0 elsewhere.
inline Greys greys_of(View<const float, 3> laid, View<const float, 2> detail) {
  const i64 height = detail.shape[0], width = detail.shape[1];
  Greys out{Array<float, 2>(height, width), Array<float, 2>(height, width), Array<float, 2>(height, width)};
  for (i64 row = 0; row < height; row++)
    for (i64 column = 0; column < width; column++) {
      const float weight = laid(row, column, 1), grey = detail(row, column);
      const float covered = (weight > COVERED) & (grey < free_space::SHADELESS) ? 1.0f : 0.0f;
      out.both(row, column) = covered;
      out.theirs(row, column) = covered * laid(row, column, 0) / std::max(weight, COVERED);
      out.ours(row, column) = covered * grey;
    }
  return out;
}

// The row or column that is seen in a place beyond the first or the last.
inline i64 mirrored(i64 place, i64 size) {
  return std::max<i64>(0, std::min({std::abs(place), 2 * size - 2 - place, size - 1}));
}

// Add a row of the images to the sums (5, w + window) over the window's rows, of each column.
inline void add_row(const Greys &greys, i64 row, double sign, View<double, 2> columns, i64 half) {
  const View<const float, 1> both = greys.both.row(row), theirs = greys.theirs.row(row), ours = greys.ours.row(row);
  double *__restrict n = columns.row(0).from(half).data, *__restrict a = columns.row(1).from(half).data;
  double *__restrict b = columns.row(2).from(half).data, *__restrict aa = columns.row(3).from(half).data;
  double *__restrict bb = columns.row(4).from(half).data;
  for (i64 column = 0; column < both.size(); column++) {
    const double p = theirs(column), q = ours(column);
    n[column] += sign * both(column);
    a[column] += sign * p, b[column] += sign * q;
    aa[column] += sign * p * p, bb[column] += sign * q * q;
  }
}

// Fill the columns on either side of the image.
inline void mirror_rim(View<double, 2> columns, i64 half, i64 width) {
  for (i64 k = 0; k < half; k++) {
    const i64 left = half + mirrored(k - half, width), right = half + mirrored(width + k, width);
    for (int layer = 0; layer < LAYERS; layer++) {
      columns(layer, k) = columns(layer, left);
      columns(layer, half + width + k) = columns(layer, right);
    }
  }
}

// The sums (5, w) of the columns in the window about each pixel of a row; all at once, as each waits for itself.
inline void run(View<const double, 2> columns, i64 window, View<double, 2> sums) {
  double now[LAYERS] = {};
  for (i64 k = 0; k < window; k++)
    for (int layer = 0; layer < LAYERS; layer++) now[layer] += columns(layer, k);
  for (i64 k = 0; k < sums.shape[1]; k++)
    for (int layer = 0; layer < LAYERS; layer++) {
      sums(layer, k) = now[layer];
      now[layer] += columns(layer, k + window) - columns(layer, k);
    }
}

// What a difference from the mean is measured by: the standard deviation, and what is noise at least.
inline double contrast(double mean, double mean_square) {
  return std::sqrt(std::max(mean_square - mean * mean, 0.0)) + CONTRAST;
}

// Add the pixels of a row to the sums `out (10,)`, given those of the windows about them.
inline void compare_row(View<const float, 1> both, View<const float, 1> theirs, View<const float, 1> ours,
                        View<const double, 2> sums, free_space::Counts &out) {
  double shaded = 0.0, sum_a = 0.0, sum_b = 0.0, sum_aa = 0.0, sum_bb = 0.0, sum_ab = 0.0;
  for (i64 k = 0; k < both.size(); k++) {
    const bool on = both(k) != 0.0f;
    const double share = 1.0 / (on ? sums(0, k) : 1.0);
    const double mean_a = sums(1, k) * share, mean_b = sums(2, k) * share;
    const double p = (theirs(k) - mean_a) / contrast(mean_a, sums(3, k) * share);
    const double q = (ours(k) - mean_b) / contrast(mean_b, sums(4, k) * share);
    const double a = on ? p : 0.0, b = on ? q : 0.0;
    shaded += on ? 1.0 : 0.0;
    sum_a += a, sum_b += b;
    sum_aa += a * a, sum_bb += b * b, sum_ab += a * b;
  }
  using namespace free_space;
  out[SHADED] += shaded;
  out[SUM_A] += sum_a, out[SUM_B] += sum_b;
  out[SUM_AA] += sum_aa, out[SUM_BB] += sum_bb, out[SUM_AB] += sum_ab;
}

// The sums over two greys, each less its mean and by its contrast in a window about a pixel, where both have one.
// `laid (h, w, 2)` is a smoothed grey times its weight, and the weight; `detail (h, w)` is the other. Beyond the rim of
// the image lies its mirror. The sums in the window run along: each pixel enters and leaves them but once.
inline Array<double, 1> sums(View<const float, 3> laid, View<const float, 2> detail, i64 window) {
  const Greys greys = greys_of(laid, detail);
  const i64 height = detail.shape[0], width = detail.shape[1], half = window / 2;
  auto columns = zeros<double, 2>(i64{LAYERS}, width + window);
  Array<double, 2> sums(i64{LAYERS}, width);
  free_space::Counts counts{};
  for (i64 row = -half; row < half; row++) add_row(greys, mirrored(row, height), 1.0, columns, half);
  for (i64 row = 0; row < height; row++) {
    add_row(greys, mirrored(row + half, height), 1.0, columns, half);
    mirror_rim(columns, half, width);
    run(columns, window, sums);
    compare_row(greys.both.row(row), greys.theirs.row(row), greys.ours.row(row), sums, counts);
    add_row(greys, mirrored(row - half, height), -1.0, columns, half);
  }
  Array<double, 1> out(static_cast<i64>(free_space::COUNTS));
  std::copy(counts.begin(), counts.end(), out.data);
  return out;
}

inline PyMethodDef METHODS[] = {
    binding::method<laid>("laid", "The grey of points laid into an image: (h, w, 2), grey times weight, and weight."),
    binding::method<mirrored>("mirrored", "The row or column that is seen in a place beyond the rim."),
    binding::method<sums>("sums", "The sums (10,) over two greys for their correlation."),
    {nullptr, nullptr, 0, nullptr},
};
}  // namespace objreg::photometric
