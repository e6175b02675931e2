// SPDX-License-Identifier: Apache-2.0
// The kernels of closest_points.py.
#pragma once
#include "objreg_ros/native/binding.hpp"

namespace objreg::closest_points {
constexpr u16 NO_POINT = 65535;  // of a cell that no point is near: NO_POINT in closest_points.py

// Give a cell to a point if it is closer to its middle than the cell's own; whether it is.
inline bool claims(i32 i, View<const float, 2> places, i64 a, i64 b, i64 c, View<u16, 3> closest,
                   View<float, 3> distance) {
  const float x = static_cast<float>(a) - places(i, 0), y = static_cast<float>(b) - places(i, 1);
  const float z = static_cast<float>(c) - places(i, 2), d = x * x + y * y + z * z;
  if (i == closest(a, b, c) || !(d < distance(a, b, c))) return false;
  closest(a, b, c) = static_cast<u16>(i), distance(a, b, c) = d;
  return true;
}

// The grid, a cell of which knows the closest point. Every point claims its cell and those next to it, and from there
// cells hand it on: a cell that got a closer point hands it to its six neighbours, as far as `reach` goes. Where many
// points are about as close that is not always the closest, but one next to it.
inline Array<u16, 3> closest(View<const float, 2> xyz, View<const float, 1> low, float cell, View<const i64, 1> shape,
                             float reach) {
  const i64 size[3] = {shape(0), shape(1), shape(2)}, cells = size[0] * size[1] * size[2];
  auto closest = full<u16, 3>(NO_POINT, size[0], size[1], size[2]);
  auto distance = full<float, 3>((reach / cell) * (reach / cell), size[0], size[1], size[2]);
  auto waiting = zeros<bool, 3>(size[0], size[1], size[2]);
  Array<float, 2> places(xyz.size(), 3);  // in cells, from the middle of the first
  for (i64 i = 0; i < xyz.size(); i++)
    for (int k = 0; k < 3; k++) places(i, k) = (xyz(i, k) - low(k)) / cell - 0.5f;
  Array<i32, 2> queue(cells, 3);
  i64 head = 0, count = 0;
  const auto ask = [&](i32 i, i64 a, i64 b, i64 c) {  // and let a cell that got a closer point wait
    if (!claims(i, places, a, b, c, closest, distance) || waiting(a, b, c)) return;
    waiting(a, b, c) = true;
    const i64 end = head + count, last = end < cells ? end : end - cells;
    queue(last, 0) = static_cast<i32>(a), queue(last, 1) = static_cast<i32>(b), queue(last, 2) = static_cast<i32>(c);
    count++;
  };
  for (i64 i = 0; i < places.size(); i++) {
    i64 first[3], end[3];
    for (int k = 0; k < 3; k++) {
      const i64 middle = static_cast<i64>(places(i, k) + 0.5);
      first[k] = std::max<i64>(0, middle - 1), end[k] = std::min(size[k], middle + 2);
    }
    for (i64 a = first[0]; a < end[0]; a++)
      for (i64 b = first[1]; b < end[1]; b++)
        for (i64 c = first[2]; c < end[2]; c++) ask(static_cast<i32>(i), a, b, c);
  }
  while (count > 0) {
    const i64 a = queue(head, 0), b = queue(head, 1), c = queue(head, 2);
    head = head + 1 < cells ? head + 1 : 0, count--;
    waiting(a, b, c) = false;
    const i32 i = closest(a, b, c);
    if (a > 0) ask(i, a - 1, b, c);
    if (a + 1 < size[0]) ask(i, a + 1, b, c);
    if (b > 0) ask(i, a, b - 1, c);
    if (b + 1 < size[1]) ask(i, a, b + 1, c);
    if (c > 0) ask(i, a, b, c - 1);
    if (c + 1 < size[2]) ask(i, a, b, c + 1);
  }
  return closest;
}

inline PyMethodDef METHODS[] = {
    binding::method<closest>("closest", "The grid (a, b, c) of points (N, 3) that a surface has."),
    {nullptr, nullptr, 0, nullptr},
};
}  // namespace objreg::closest_points
