// SPDX-License-Identifier: Apache-2.0
// The kernels of fpfh.py.
#pragma once
#include "objreg_ros/native/binding.hpp"

namespace objreg::fpfh {
constexpr i64 BINS = 11, ALL_BINS = 3 * BINS;
constexpr i64 CROWD = 256;    // most neighbours of a point
constexpr float FAR = 1e30f;  // a squared distance beyond all
constexpr double PI = 3.141592653589793;

// The nearest partner of each of N and each of M histograms, `a (N, K)` and `b (K, M)`, in one pass, and the squared
// distances to them: (N,), (M,), (N,), (M,). Not by BLAS, whose own threads wait for each other and spin meanwhile,
// while two places are tried at once.
inline std::tuple<Array<i64, 1>, Array<i64, 1>, Array<float, 1>, Array<float, 1>> nearest(View<const float, 2> a,
                                                                                          View<const float, 2> b) {
  const i64 n = a.size(), m = b.shape[1];
  auto forward = zeros<i64, 1>(n), backward = zeros<i64, 1>(m);
  auto ahead = full<float, 1>(FAR, n), behind = full<float, 1>(FAR, m);
  Array<float, 1> sums(m);
  float *__restrict squared = sums.data;
  for (i64 i = 0; i < n; i++) {
    sums.fill(0.0f);
    for (i64 k = 0; k < b.size(); k++) {
      const float own = a(i, k);
      const float *__restrict other = b.row(k).data;
      for (i64 j = 0; j < m; j++) squared[j] += (own - other[j]) * (own - other[j]);
    }
    float best = FAR;
    i64 where = 0;
    for (i64 j = 0; j < m; j++) {
      if (squared[j] < best) best = squared[j], where = j;
      if (squared[j] < behind(j)) behind(j) = squared[j], backward(j) = i;
    }
    ahead(i) = best, forward(i) = where;
  }
  return {std::move(forward), std::move(backward), std::move(ahead), std::move(behind)};
}

struct Cells {  // `_cells` of fpfh.py
  View<const i64, 1> order, first;
  View<const float, 1> low;
  View<const i64, 1> shape;
  float size;
};

// Fill `found` and `squared` with the points within `radius` of point i but itself; returns how many.
inline i64 neighbours(View<const float, 2> xyz, i64 i, const Cells &cells, float radius, View<i32, 1> found,
                      View<float, 1> squared) {
  i64 n = 0, at[3];
  for (int k = 0; k < 3; k++) at[k] = static_cast<i64>((xyz(i, k) - cells.low(k)) / cells.size);
  const auto shape = cells.shape;
  const float x = xyz(i, 0), y = xyz(i, 1), z = xyz(i, 2);
  for (i64 a = std::max<i64>(0, at[0] - 1); a < std::min(shape(0), at[0] + 2); a++)
    for (i64 b = std::max<i64>(0, at[1] - 1); b < std::min(shape(1), at[1] + 2); b++) {
      const i64 row = (a * shape(1) + b) * shape(2);
      const i64 end = cells.first(row + std::min(shape(2), at[2] + 2));
      for (i64 s = cells.first(row + std::max<i64>(0, at[2] - 1)); s < end; s++) {
        const i64 j = cells.order(s);
        const float dx = xyz(j, 0) - x, dy = xyz(j, 1) - y, dz = xyz(j, 2) - z;
        const float d2 = dx * dx + dy * dy + dz * dz;
        if (j != i && 1e-10 < d2 && d2 <= radius * radius && n < found.size()) {
          found(n) = static_cast<i32>(j), squared(n) = d2;
          n++;
        }
      }
    }
  return n;
}

// The angle of (x, y) in rad, to 3e-4: a bin is two thousand times as wide.
inline float angle(float y, float x) {
  const float a = std::abs(x), b = std::abs(y);
  const float slope = std::min(a, b) / std::max(std::max(a, b), 1e-12f), q = slope * slope;
  float found = ((-0.0464965f * q + 0.1593142f) * q - 0.3276228f) * q * slope + slope;
  if (b > a) found = static_cast<float>(0.5 * PI) - found;
  if (x < 0.0f) found = static_cast<float>(PI) - found;
  return y < 0.0f ? -found : found;
}

inline i64 bin(double place) { return static_cast<i64>(std::min(std::max(0.0, place), 10.0)); }

// The bins (of 11 each) of the three Darboux angles of two oriented points, the same from either side. The first is -1
// where the angles are not defined.
inline std::array<i64, 3> bins(const float *p, const float *n, const float *q, const float *m, float distance) {
  float x = (q[0] - p[0]) / distance, y = (q[1] - p[1]) / distance, z = (q[2] - p[2]) / distance;
  const float a = n[0] * x + n[1] * y + n[2] * z, b = m[0] * x + m[1] * y + m[2] * z;
  const float *u = n, *w = m;
  float phi = a;
  if (std::abs(a) < std::abs(b))  // the point whose normal is closer to the line is the source
    u = m, w = n, x = -x, y = -y, z = -z, phi = -b;
  const float vx = y * u[2] - z * u[1], vy = z * u[0] - x * u[2], vz = x * u[1] - y * u[0];
  const float length = std::sqrt(vx * vx + vy * vy + vz * vz);
  if (!(length >= 1e-6)) return {-1, 0, 0};
  const float alpha = (vx * w[0] + vy * w[1] + vz * w[2]) / length;
  const float sine =
      (u[1] * vz - u[2] * vy) * w[0] + (u[2] * vx - u[0] * vz) * w[1] + (u[0] * vy - u[1] * vx) * w[2];
  const float theta = angle(sine / length, u[0] * w[0] + u[1] * w[1] + u[2] * w[2]);
  return {bin(11.0 * (theta + PI) / (2.0 * PI)), bin(11.0 * (alpha + 1.0) * 0.5), bin(11.0 * (phi + 1.0) * 0.5)};
}

// Each histogram with those of its neighbours, the near ones most.
inline Array<float, 2> weighted(View<const float, 2> simple, View<const i32, 2> found, View<const float, 2> squared,
                                View<const i64, 1> crowd) {
  Array<float, 2> out(simple.size(), ALL_BINS);
  for (i64 i = 0; i < simple.size(); i++) {
    float sums[ALL_BINS] = {};
    for (i64 s = 0; s < crowd(i); s++) {
      const float weight = 1.0f / squared(i, s);
      const float *__restrict other = simple.row(found(i, s)).data;
      for (i64 k = 0; k < ALL_BINS; k++) sums[k] += weight * other[k];
    }
    for (i64 part = 0; part < 3; part++) {
      float total = 0.0f;
      for (i64 k = 0; k < BINS; k++) total += sums[BINS * part + k];
      const float scale = 100.0f / std::max(total, 1e-9f), own = total > 0.0f ? 1.0f : 0.0f;
      for (i64 k = BINS * part; k < BINS * (part + 1); k++) out(i, k) = own * scale * sums[k] + simple(i, k);
    }
  }
  return out;
}

// FPFH (N, 33), each of the three parts summing to 100, and the number of neighbours (N,).
inline std::tuple<Array<float, 2>, Array<i64, 1>> histograms(View<const float, 2> xyz, View<const float, 2> normals,
                                                             View<const i64, 1> order, View<const i64, 1> first,
                                                             View<const float, 1> low, View<const i64, 1> shape,
                                                             float cell, float radius) {
  const i64 n = xyz.size();
  const Cells cells{order, first, low, shape, cell};
  Array<i32, 2> found(n, CROWD);
  Array<float, 2> squared(n, CROWD);
  auto simple = zeros<float, 2>(n, ALL_BINS);
  Array<i64, 1> crowd(n);
  for (i64 i = 0; i < n; i++) crowd(i) = neighbours(xyz, i, cells, radius, found.row(i), squared.row(i));
  for (i64 i = 0; i < n; i++)
    for (i64 s = 0; s < crowd(i); s++) {
      const i64 j = found(i, s);
      const bool mutual = crowd(j) < CROWD && crowd(i) < CROWD;  // a full list may lack the other
      if (mutual && j < i) continue;                             // the other one has added it to both
      const auto [a, b, c] = bins(xyz.row(i).data, normals.row(i).data, xyz.row(j).data, normals.row(j).data,
                                  std::sqrt(squared(i, s)));
      if (a < 0) continue;
      for (int k = 0; k < (mutual ? 2 : 1); k++) {
        const i64 owner = k ? j : i;
        simple(owner, a) += 1.0f;
        simple(owner, BINS + b) += 1.0f;
        simple(owner, 2 * BINS + c) += 1.0f;
      }
    }
  for (i64 i = 0; i < n; i++) {
    const float scale = static_cast<float>(100.0 / std::max<i64>(1, crowd(i)));
    for (i64 k = 0; k < ALL_BINS; k++) simple(i, k) *= scale;
  }
  return {weighted(simple, found, squared, crowd), std::move(crowd)};
}

inline PyMethodDef METHODS[] = {
    binding::method<angle>("angle", "The angle of (x, y), given as y, x, in rad, to 3e-4."),
    binding::method<histograms>("histograms", "FPFH (N, 33), and the number of neighbours (N,)."),
    binding::method<nearest>("nearest", "The nearest of N to M and of M to N histograms, and the squared distances."),
    {nullptr, nullptr, 0, nullptr},
};
}  // namespace objreg::fpfh
