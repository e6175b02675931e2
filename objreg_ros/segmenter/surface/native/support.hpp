// SPDX-License-Identifier: Apache-2.0
// The kernels of support.py.
#pragma once
#include "objreg_ros/native/binding.hpp"
#include "objreg_ros/segmenter/surface/native/cells.hpp"
#include "objreg_ros/segmenter/surface/native/solve_symmetric.hpp"

namespace objreg::support {
constexpr float TILT = 0.9396926f;            // cosine: a cell of a level surface is no farther than 20 degrees from up
constexpr double SLOPE = 0.1405408347023915;  // tangent: nor is a level plane steeper than 8 degrees
constexpr float NEAR = 2.5f;  // tolerances around a plane within which its cells are sought
// Thickness in tolerances, and number to each side, of the layers sought around a plane.
constexpr double LAYER = 0.3;
constexpr i64 LAYERS = 5;
constexpr double CLIPS[] = {1.0, 1.5, 1.5, 2.5, 3.0, 3.0};  // the first of the tolerance, the others of the spread
constexpr i64 ROUNDS = 6;                                   // as many as there are clips

// Of a surface: depth (h, w), normals (3, h, w), and the slopes x (w,) and y (h,) of its rays.
using Grid = std::tuple<View<const float, 2>, View<const float, 3>, View<const float, 1>, View<const float, 1>>;
using Tolerance = std::array<float, 2>;  // a plane's: m, and its growth with the square of the depth, 1/m

// `low` and `high` (w,) are the lowest and the highest level cell of each column so far.
inline void survey_row(const float *__restrict depth, const float *__restrict n_x, const float *__restrict n_y,
                       const float *__restrict n_z, const float *__restrict x, float y, i64 width,
                       std::array<float, 3> up, float pixel, float *__restrict height, float *__restrict area,
                       float *__restrict low, float *__restrict high) {
  for (i64 j = 0; j < width; j++) {
    const float z = depth[j];
    const bool level = n_x[j] * up[0] + n_y[j] * up[1] + n_z[j] * up[2] > TILT;
    const float flat = std::max(std::abs(n_x[j] * x[j] + n_y[j] * y + n_z[j]), cells::MIN_COSINE);
    const float h = z * (up[0] * x[j] + up[1] * y + up[2]);
    const float covered = z * z * pixel / flat;
    height[j] = h;
    area[j] = level ? covered : 0.0f;
    low[j] = level & (h < low[j]) ? h : low[j];
    high[j] = level & (h > high[j]) ? h : high[j];
  }
}

// Fill the height along up and the m² of each level cell, 0 for the others; the lowest and the highest one.
inline std::tuple<float, float> survey(Grid grid, View<const float, 1> up, float pixel, View<float, 2> height,
                                       View<float, 2> area) {
  const auto &[depth, normals, x, y] = grid;
  const i64 w = depth.shape[1];
  const auto n_x = normals.row(0), n_y = normals.row(1), n_z = normals.row(2);
  constexpr float beyond = std::numeric_limits<float>::infinity();
  auto lows = full<float, 1>(beyond, w), highs = full<float, 1>(-beyond, w);
  for (i64 i = 0; i < depth.shape[0]; i++)
    survey_row(depth.row(i).data, n_x.row(i).data, n_y.row(i).data, n_z.row(i).data, x.data, y(i), w,
               {up(0), up(1), up(2)}, pixel, height.row(i).data, area.row(i).data, lows.data, highs.data);
  float low = beyond, high = -beyond;
  for (i64 j = 0; j < w; j++) low = std::min(low, lows(j)), high = std::max(high, highs(j));
  return {low, high};
}

// The height in `low` ... `high`, in bins of `bin` m, that most `area` has, how much it is, and how many cells have
// any.
inline std::tuple<double, double, i64> commonest(View<const float, 2> height, View<const float, 2> area, double low,
                                                 double high, double bin) {
  if (!(low <= high)) return {0.0, 0.0, 0};
  auto votes = zeros<double, 1>(static_cast<i64>((high - low) / bin) + 3);
  i64 count = 0;
  for (i64 i = 0; i < height.shape[0]; i++) {
    const auto heights = height.row(i), areas = area.row(i);
    for (i64 j = 0; j < heights.size(); j++) {
      if (!(areas(j) > 0.0f)) continue;
      votes(static_cast<i64>((heights(j) - low) / bin) + 1) += areas(j);
      count++;
    }
  }
  i64 best = 1;
  double most = 0.0;
  for (i64 k = 1; k < votes.size() - 1; k++) {
    const double smooth = votes(k) + 0.5 * (votes(k - 1) + votes(k + 1));
    if (smooth > most) best = k, most = smooth;
  }
  return {low + (best - 0.5) * bin, most, count};
}

// Fill `taken` (w,) with the m² of the plane's cells of a row, 0 for the others, and take them and those just off the
// plane out of `area`; `ahead` is n_y y + n_z.
inline void claim_row(const float *__restrict depth, const float *__restrict x, i64 width, float n_x, float ahead,
                      float offset, Tolerance tolerance, float *__restrict area, float *__restrict taken) {
  for (i64 j = 0; j < width; j++) {
    const float z = depth[j], covered = area[j];
    const float off = std::abs(z * (n_x * x[j] + ahead) + offset), unit = tolerance[0] + tolerance[1] * z * z;
    taken[j] = off < unit ? covered : 0.0f;
    area[j] = off < 1.5f * unit ? 0.0f : covered;
  }
}

// Fill `cells` with where a plane is, and take those, and what is just off it, out of `area`, which is 0 or more; the
// m² of the plane.
inline double claim(View<const float, 2> depth, View<const float, 1> x, View<const float, 1> y,
                    View<const float, 1> n, float offset, Tolerance tolerance, View<float, 2> area,
                    View<bool, 2> cells) {
  const i64 w = depth.shape[1];
  Array<float, 1> taken(w);
  double total = 0.0;
  for (i64 i = 0; i < depth.shape[0]; i++) {
    claim_row(depth.row(i).data, x.data, w, n(0), n(1) * y(i) + n(2), offset, tolerance, area.row(i).data, taken.data);
    const float *__restrict squares = taken.data;
    bool *__restrict marks = cells.row(i).data;
    for (i64 j = 0; j < w; j++) total += squares[j];
    for (i64 j = 0; j < w; j++) marks[j] = squares[j] > 0.0f;
  }
  return total;
}

using Axis = std::array<double, 3>;

inline double dot(Axis a, Axis b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

// Two level axes and `up`.
inline std::array<Axis, 3> level_frame(Axis up) {
  Axis side{};
  if (std::abs(up[2]) < 0.9) side[0] = up[1], side[1] = -up[0];
  else side[1] = up[2], side[2] = -up[1];
  const double length = std::sqrt(dot(side, side));
  for (double &part : side) part /= length;
  Axis other;
  for (int k = 0; k < 3; k++) {
    const int p = (k + 1) % 3, q = (k + 2) % 3;
    other[k] = up[p] * side[q] - up[q] * side[p];
  }
  return {side, other, up};
}

// Fill `samples` with s, t in the plane, height over `start` and 1 / tolerance, of the level cells near it.
inline i64 sample(const Grid &grid, View<const bool, 2> cells, const std::array<Axis, 3> &frame,
                  std::array<float, 3> start, Tolerance tolerance, i64 stride, View<float, 2> samples) {
  const auto &[depth, normals, x, y] = grid;
  float axes[3][3];
  for (int k = 0; k < 3; k++)
    for (int c = 0; c < 3; c++) axes[k][c] = static_cast<float>(frame[k][c]);
  const auto [a_x, a_y, a_z] = axes[0];
  const auto [b_x, b_y, b_z] = axes[1];
  const auto [u_x, u_y, u_z] = axes[2];
  const auto all_x = normals.row(0), all_y = normals.row(1), all_z = normals.row(2);
  const auto sides = samples.row(0), others = samples.row(1), heights = samples.row(2), sharpness = samples.row(3);
  i64 n = 0;
  for (i64 i = 0; i < depth.shape[0]; i += stride) {
    const auto row = depth.row(i), n_x = all_x.row(i), n_y = all_y.row(i), n_z = all_z.row(i);
    const auto wanted = cells.row(i);
    for (i64 j = 0; j < row.size(); j += stride) {
      if (!wanted(j)) continue;
      const float cosine = n_x(j) * u_x + n_y(j) * u_y + n_z(j) * u_z;
      if (cosine < TILT) continue;
      const float z = row(j), p_x = x(j) * z, p_y = y(i) * z;
      const float s = a_x * p_x + a_y * p_y + a_z * z, t = b_x * p_x + b_y * p_y + b_z * z;
      const float r = u_x * p_x + u_y * p_y + u_z * z - (start[0] + start[1] * s + start[2] * t);
      const float unit = tolerance[0] + tolerance[1] * z * z;
      if (!(std::abs(r) < NEAR * unit)) continue;
      sides(n) = s, others(n) = t, heights(n) = r, sharpness(n) = 1.0f / unit;
      n++;
    }
  }
  return n;
}

// The height of the lowest layer of many samples, in units of the tolerance.
inline double lowest_layer(View<const float, 1> heights, View<const float, 1> sharpness) {
  constexpr i64 size = 2 * LAYERS + 3;
  double votes[size] = {};
  for (i64 n = 0; n < heights.size(); n++) {
    const float place = heights(n) * sharpness(n) * float(1.0 / LAYER) + float(LAYERS + 1.5);  // above 0: near a plane
    const i64 k = static_cast<i64>(place);
    if (0 <= k && k < size) votes[k]++;
  }
  double most = 0.0;
  for (double vote : votes) most = std::max(most, vote);
  for (i64 k = 1; k < size - 1; k++)
    if (votes[k] >= most / 2.0 && votes[k] >= votes[k + 1]) return static_cast<double>(k - LAYERS - 1) * LAYER;
  return 0.0;
}

struct Sums {  // of the samples within a limit: of weights times powers of s and t, and those times the error
  float m, m_s, m_t, m_ss, m_st, m_tt, v, v_s, v_t, square, count;
};

inline Sums sum_up(const float *__restrict sides, const float *__restrict others, const float *__restrict heights,
                   const float *__restrict sharpness, i64 size, float c, float a, float b, float shift, float limit) {
  float m = 0, m_s = 0, m_t = 0, m_ss = 0, m_st = 0, m_tt = 0, v = 0, v_s = 0, v_t = 0, square = 0, count = 0;
  for (i64 n = 0; n < size; n++) {
    const float s = sides[n], t = others[n], sharp = sharpness[n];
    const float r = heights[n] - c - a * s - b * t;
    const bool inside = std::abs(r * sharp - shift) < limit;
    const float g = inside ? sharp * sharp : 0.0f;
    count += inside ? 1.0f : 0.0f;
    square += g * r * r;
    m += g, m_s += g * s, m_t += g * t;
    m_ss += g * s * s, m_st += g * s * t, m_tt += g * t * t;
    v += g * r, v_s += g * s * r, v_t += g * t * r;
  }
  return {m, m_s, m_t, m_ss, m_st, m_tt, v, v_s, v_t, square, count};
}

// Fill `levels` with c, a, b of height = c + a s + b t and the spread; whether at least `least` samples agree.
inline bool fit(View<const float, 2> samples, i64 size, i64 least, bool lowest, std::array<double, 4> &levels) {
  const auto sides = samples.row(0).cut(0, size), others = samples.row(1).cut(0, size);
  const auto heights = samples.row(2).cut(0, size), sharpness = samples.row(3).cut(0, size);
  float shift = lowest ? static_cast<float>(lowest_layer(heights, sharpness)) : 0.0f;
  float limit = static_cast<float>(lowest ? LAYER : CLIPS[0]);
  for (i64 k = 0; k < ROUNDS; k++) {
    const float c = static_cast<float>(levels[0]), a = static_cast<float>(levels[1]), b = static_cast<float>(levels[2]);
    const Sums of = sum_up(sides.data, others.data, heights.data, sharpness.data, size, c, a, b, shift, limit);
    if (of.count < least) return false;
    const double ridge = 1e-6 * of.m;
    const auto step = solve_symmetric({of.m + ridge, of.m_s, of.m_t, of.m_ss + ridge, of.m_st, of.m_tt + ridge},
                                      {of.v, of.v_s, of.v_t});
    for (int d = 0; d < 3; d++) levels[d] += step[d];
    levels[3] = std::max(std::sqrt(of.square / of.count), 0.02f);
    shift = 0.0f;
    limit = static_cast<float>(CLIPS[std::min(k + 1, ROUNDS - 1)] * levels[3]);
  }
  return true;
}

// Whether there is a plane of at least `least` cells; its normal, offset and spread.
inline std::tuple<bool, Array<double, 1>, double, double> fit_level(Grid grid, View<const bool, 2> cells,
                                                                    View<const double, 1> upwards,
                                                                    View<const double, 1> normal, double offset,
                                                                    Tolerance tolerance, i64 least, i64 stride,
                                                                    bool lowest) {
  const Axis up{upwards(0), upwards(1), upwards(2)}, given{normal(0), normal(1), normal(2)};
  const auto frame = level_frame(up);
  const double n_side = dot(frame[0], given), n_other = dot(frame[1], given), n_up = dot(frame[2], given);
  const std::array<float, 3> start{static_cast<float>(-offset / n_up), static_cast<float>(-n_side / n_up),
                                   static_cast<float>(-n_other / n_up)};
  const i64 rows = (cells.shape[0] + stride - 1) / stride, columns = (cells.shape[1] + stride - 1) / stride;
  Array<float, 2> samples(4, rows * columns);
  Array<double, 1> tilted(3);
  for (int k = 0; k < 3; k++) tilted(k) = given[k];
  const i64 count = sample(grid, cells, frame, start, tolerance, stride, samples);
  std::array<double, 4> levels{};
  if (count < least || !fit(samples, count, least, lowest, levels) || std::hypot(levels[1], levels[2]) > SLOPE)
    return {false, std::move(tilted), offset, 0.0};
  const double side = levels[1] + start[1], other = levels[2] + start[2];
  for (int k = 0; k < 3; k++) tilted(k) = up[k] - side * frame[0][k] - other * frame[1][k];
  const double length = std::sqrt(dot({tilted(0), tilted(1), tilted(2)}, {tilted(0), tilted(1), tilted(2)}));
  for (int k = 0; k < 3; k++) tilted(k) /= length;
  return {true, std::move(tilted), -(levels[0] + start[0]) / length, levels[3]};
}

inline PyMethodDef METHODS[] = {
    binding::method<survey>("survey", "Fill heights and areas; the lowest and the highest level cell."),
    binding::method<commonest>("commonest", "The height that most area has, that area, and its cells."),
    binding::method<claim>("claim", "Mark the cells of a plane; its area."),
    binding::method<fit_level>("fit_level", "Whether there is a level plane; its normal, offset and spread."),
    {nullptr, nullptr, 0, nullptr},
};
}  // namespace objreg::support
