// SPDX-License-Identifier: Apache-2.0
// The kernel of same_pose.py.
#pragma once
#include "objreg_ros/native/binding.hpp"

namespace objreg::same_pose {
// The first of the poses (N, 4, 4) in an order, at most `limit`, no two of which turn and take the middle to as near.
inline Array<i64, 1> distinct(View<const double, 3> T, View<const double, 2> centres, View<const i64, 1> order,
                              i64 limit, double cosine, double distance) {
  Array<i64, 1> chosen(limit);
  i64 n = 0;
  for (i64 at = 0; at < order.size() && n < limit; at++) {
    const i64 k = order(at);
    bool known = false;
    for (i64 m = 0; m < n && !known; m++) {
      const i64 c = chosen(m);
      double trace = 0.0, gap = 0.0;
      for (int a = 0; a < 3; a++) {
        const double apart = centres(c, a) - centres(k, a);
        gap += apart * apart;
        for (int b = 0; b < 3; b++) trace += T(c, a, b) * T(k, a, b);
      }
      known = gap < distance * distance && 0.5 * (trace - 1.0) > cosine;
    }
    if (!known) chosen(n++) = k;
  }
  return std::move(chosen).first(n);
}

inline PyMethodDef METHODS[] = {
    binding::method<distinct>("distinct", "Indices (n,) of the best poses, no two of which are the same."),
    {nullptr, nullptr, 0, nullptr},
};
}  // namespace objreg::same_pose
