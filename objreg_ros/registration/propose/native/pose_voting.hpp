// SPDX-License-Identifier: Apache-2.0
// The kernels of pose_voting.py.
#pragma once
#include <limits>

#include "objreg_ros/native/binding.hpp"

namespace objreg::pose_voting {
// The square of 0.1 mm: a baseline that is no farther aside of its direction fixes no pose with it.
constexpr double ASIDE = 1e-8;

using Vectors = View<const double, 2>;
using Vector = std::array<double, 3>;

inline Vector at(Vectors of, i64 i) { return {of(i, 0), of(i, 1), of(i, 2)}; }
inline Vector minus(const Vector &a, const Vector &b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }
inline double dot(const Vector &a, const Vector &b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

// The square of how far the sum of two normals is aside of a baseline; 0 where that has no length.
inline double aside(const Vector &n, const Vector &m, const Vector &baseline, double length) {
  if (length == 0.0) return 0.0;
  const double along = (dot(n, baseline) + dot(m, baseline)) / length;
  return dot(n, n) + 2.0 * dot(n, m) + dot(m, m) - along * along;
}

// Pairs (K, 2) of matches that one rigid motion can explain, from the best ones on, at most `most`. Most pairs fail by
// their length or their height, which is looked at for several of them at a time.
inline Array<i64, 2> consistent_pairs(Vectors P, Vectors Q, Vectors N, Vectors M, View<const double, 1> up_p,
                                      View<const double, 1> up_q, bool upright, double tolerance, double shortest,
                                      i64 most) {
  const i64 size = P.size();
  Array<i64, 2> found(most, 2);
  Array<bool, 1> known(size);
  Array<u32, 1> alike(size);
  Array<double, 2> columns(6, size);
  const Vector up_source{up_p(0), up_p(1), up_p(2)}, up_target{up_q(0), up_q(1), up_q(2)};
  for (i64 i = 0; i < size; i++) {
    known(i) = dot(at(N, i), at(N, i)) > 0.5 && dot(at(M, i), at(M, i)) > 0.5;
    for (int k = 0; k < 3; k++) columns(k, i) = P(i, k), columns(3 + k, i) = Q(i, k);
  }
  const double *__restrict px = columns.row(0).data, *__restrict py = columns.row(1).data;
  const double *__restrict pz = columns.row(2).data, *__restrict qx = columns.row(3).data;
  const double *__restrict qy = columns.row(4).data, *__restrict qz = columns.row(5).data;
  const double uneven = upright ? tolerance : std::numeric_limits<double>::infinity();
  Array<i64, 1> keeps(size);
  i64 n = 0;
  for (i64 j = 1; j < size; j++) {
    const Vector p = at(P, j), q = at(Q, j), nj = at(N, j), mj = at(M, j);
    for (i64 i = 0; i < j; i++) {  // several pairs at a time
      const double ax = p[0] - px[i], ay = p[1] - py[i], az = p[2] - pz[i];
      const double bx = q[0] - qx[i], by = q[1] - qy[i], bz = q[2] - qz[i];
      const double lp = std::sqrt(ax * ax + ay * ay + az * az), lq = std::sqrt(bx * bx + by * by + bz * bz);
      const double hp = ax * up_source[0] + ay * up_source[1] + az * up_source[2];
      const double hq = bx * up_target[0] + by * up_target[1] + bz * up_target[2];
      keeps.data[i] = (lp >= shortest) & (std::abs(lp - lq) <= tolerance) & (std::abs(hp - hq) <= uneven);
    }
    i64 count = 0;
    for (i64 i = 0; i < j; i++) alike(count) = static_cast<u32>(i), count += keeps(i);
    for (i64 k = 0; k < count; k++) {
      const i64 i = alike(k);
      const Vector dp = minus(p, at(P, i)), dq = minus(q, at(Q, i)), ni = at(N, i), mi = at(M, i);
      const double lp = std::sqrt(dot(dp, dp)), lq = std::sqrt(dot(dq, dq));
      if (upright) {
        const double hp = dot(dp, up_source), hq = dot(dq, up_target);
        if (lp * lp - hp * hp < 0.5 * shortest * shortest || lq * lq - hq * hq < ASIDE) continue;
      } else if (std::min(aside(ni, nj, dp, lp), aside(mi, mj, dq, lq)) < ASIDE) {
        continue;
      }
      if (known(i) && known(j)) {
        if (std::abs(dot(ni, nj) - dot(mi, mj)) > 0.25 || std::abs(dot(ni, dp) / lp - dot(mi, dq) / lq) > 0.25 ||
            std::abs(dot(nj, dp) / lp - dot(mj, dq) / lq) > 0.25)
          continue;
      } else if (!upright) {
        continue;
      }
      found(n, 0) = i, found(n, 1) = j;
      if (++n == most) return found;
    }
  }
  return std::move(found).first(n);
}

// A right-handed frame: its third axis along `axis`, its first along what of `direction` is not.
inline std::array<Vector, 3> axes(const Vector &direction, const Vector &axis) {
  const double length = std::sqrt(dot(axis, axis)) + 1e-18;
  const Vector z{axis[0] / length, axis[1] / length, axis[2] / length};
  const double along = dot(direction, z);
  Vector x{direction[0] - along * z[0], direction[1] - along * z[1], direction[2] - along * z[2]};
  const double n = std::sqrt(dot(x, x)) + 1e-9;
  x = {x[0] / n, x[1] / n, x[2] / n};
  return {x, Vector{z[1] * x[2] - z[2] * x[1], z[2] * x[0] - z[0] * x[2], z[0] * x[1] - z[1] * x[0]}, z};
}

// Fill `T` (4, 4) with the rotation that takes an axis and, about it, a direction to others.
inline void turn(const Vector &from_direction, const Vector &from_axis, const Vector &to_direction,
                 const Vector &to_axis, View<double, 2> T) {
  const auto a = axes(from_direction, from_axis), b = axes(to_direction, to_axis);
  for (int r = 0; r < 3; r++)
    for (int c = 0; c < 3; c++) T(r, c) = b[0][r] * a[0][c] + b[1][r] * a[1][c] + b[2][r] * a[2][c];
}

// The pose (K, 4, 4) of each pair of matches.
inline Array<double, 3> poses(Vectors P, Vectors Q, Vectors N, Vectors M, View<const double, 1> up_p,
                              View<const double, 1> up_q, bool upright, View<const i64, 2> pairs) {
  auto T = zeros<double, 3>(pairs.size(), 4, 4);
  const Vector up_source{up_p(0), up_p(1), up_p(2)}, up_target{up_q(0), up_q(1), up_q(2)};
  for (i64 k = 0; k < pairs.size(); k++) {
    const i64 i = pairs(k, 0), j = pairs(k, 1);
    const Vector dp = minus(at(P, j), at(P, i)), dq = minus(at(Q, j), at(Q, i));
    Vector n, m;
    for (int a = 0; a < 3; a++) n[a] = N(i, a) + N(j, a) + 1e-9, m[a] = M(i, a) + M(j, a) + 1e-9;
    const auto R = T.row(k);
    if (upright) turn(dp, up_source, dq, up_target, R);
    else turn(n, dp, m, dq, R);  // the baseline is exact, the normals are not: they turn about it
    for (int a = 0; a < 3; a++) {
      R(a, 3) = 0.5 * (Q(i, a) + Q(j, a));
      for (int b = 0; b < 3; b++) R(a, 3) -= R(a, b) * 0.5 * (P(i, b) + P(j, b));
    }
    R(3, 3) = 1.0;
  }
  return T;
}

// The weight of the matches, columns (3, M), that each pose (K, 4, 4) brings together. Without branches, so that it
// runs in lanes.
inline Array<double, 1> support(View<const float, 2> P, View<const float, 2> Q, View<const float, 1> weights,
                                View<const float, 3> T, float tolerance) {
  Array<double, 1> out(T.size());
  const float *__restrict px = P.row(0).data, *__restrict py = P.row(1).data, *__restrict pz = P.row(2).data;
  const float *__restrict qx = Q.row(0).data, *__restrict qy = Q.row(1).data, *__restrict qz = Q.row(2).data;
  const float *__restrict weight = weights.data;
  const float scale = 1.0f / (tolerance * tolerance);
  for (i64 k = 0; k < T.size(); k++) {
    const float r00 = T(k, 0, 0), r01 = T(k, 0, 1), r02 = T(k, 0, 2), tx = T(k, 0, 3);
    const float r10 = T(k, 1, 0), r11 = T(k, 1, 1), r12 = T(k, 1, 2), ty = T(k, 1, 3);
    const float r20 = T(k, 2, 0), r21 = T(k, 2, 1), r22 = T(k, 2, 2), tz = T(k, 2, 3);
    float total = 0.0f;
    for (i64 m = 0; m < weights.size(); m++) {
      const float x = r00 * px[m] + r01 * py[m] + r02 * pz[m] + tx - qx[m];
      const float y = r10 * px[m] + r11 * py[m] + r12 * pz[m] + ty - qy[m];
      const float z = r20 * px[m] + r21 * py[m] + r22 * pz[m] + tz - qz[m];
      total += weight[m] * std::max(0.0f, 1.0f - scale * (x * x + y * y + z * z));
    }
    out(k) = total;
  }
  return out;
}

inline PyMethodDef METHODS[] = {
    binding::method<consistent_pairs>("consistent_pairs", "Pairs (K, 2) of matches that one rigid motion can explain."),
    binding::method<poses>("poses", "The pose (K, 4, 4) of each pair of matches."),
    binding::method<support>("support", "The weight of the matches that each pose (K, 4, 4) brings together: (K,)."),
    {nullptr, nullptr, 0, nullptr},
};
}  // namespace objreg::pose_voting
