// SPDX-License-Identifier: Apache-2.0
// The kernels of projection.py: where a camera sees points, and what its image holds there. Other kernels begin with
// them.
#pragma once
#include "objreg_ros/native/binding.hpp"

namespace objreg::projection {
constexpr double LEAST_DEPTH = 0.1;  // m: nearer points are taken for points behind the camera
constexpr i64 BLOCK = 256;           // points that `landing` looks at together

struct Places { Array<double, 1> x, y, z; };
struct Pixel { u32 row, column; };

// The x, y and z (N,) of `points (N, 3)` moved by `T (4, 4)`.
template <class P> Places moved(View<P, 2> points, View<const double, 2> T) {
  const double xx = T(0, 0), xy = T(0, 1), xz = T(0, 2), x0 = T(0, 3);
  const double yx = T(1, 0), yy = T(1, 1), yz = T(1, 2), y0 = T(1, 3);
  const double zx = T(2, 0), zy = T(2, 1), zz = T(2, 2), z0 = T(2, 3);
  const i64 n = points.size();
  check(2, points.shape[1]);
  Places out{Array<double, 1>(n), Array<double, 1>(n), Array<double, 1>(n)};
  double *__restrict x = out.x.data, *__restrict y = out.y.data, *__restrict z = out.z.data;
  const P *__restrict p = points.data;
  const auto move = [&](auto stride) {
    for (i64 i = 0; i < n; i++) {
      const double a = p[i * stride], b = p[i * stride + 1], c = p[i * stride + 2];
      x[i] = xx * a + xy * b + xz * c + x0;
      y[i] = yx * a + yy * b + yz * c + y0;
      z[i] = zx * a + zy * b + zz * c + z0;
    }
  };
  if (points.stride[0] == 3) move(std::integral_constant<i64, 3>());  // several points at a time
  else move(points.stride[0]);
  return out;
}

// The pixels u, v and the depths z (N,) of `points (N, 3)` moved by `T (4, 4)`; for `lands` to sort out.
template <class P> Places project(View<P, 2> points, View<const double, 2> T, const std::array<double, 4> &camera) {
  const auto [fx, fy, cx, cy] = camera;
  Places out = moved(points, T);
  double *__restrict u = out.x.data, *__restrict v = out.y.data, *__restrict z = out.z.data;
  for (i64 i = 0; i < points.size(); i++) {
    const double inverse = 1.0 / std::max(z[i], LEAST_DEPTH);
    u[i] = fx * u[i] * inverse + cx;
    v[i] = fy * v[i] * inverse + cy;
  }
  return out;
}
template <class P, class C> Places project(View<P, 2> points, View<const double, 2> T, View<C, 1> camera) {
  return project(points, T, std::array<double, 4>{camera(0), camera(1), camera(2), camera(3)});
}

// Whether a point at a depth is before the camera and between four pixels of an `image (h, w)`.
template <class T> bool lands(double u, double v, double z, View<T, 2> image) {
  return (z >= LEAST_DEPTH) & (u >= 0.0) & (v >= 0.0) & (u <= image.shape[1] - 1.001) & (v <= image.shape[0] - 1.001);
}

// The row and the column of the pixel that a place in the image is in.
inline Pixel nearest(double u, double v) { return {static_cast<u32>(v + 0.5), static_cast<u32>(u + 0.5)}; }

struct Slopes { double value, u, v; };

// The bilinear value of an `image (h, w)` at a place between four pixels, and its slopes along u and v.
template <class T> Slopes between(View<T, 2> image, double u, double v) {
  const u32 left = static_cast<u32>(u), top = static_cast<u32>(v);
  const double a = u - left, b = v - top;
  const auto p = image(top, left), q = image(top, left + 1), r = image(top + 1, left), s = image(top + 1, left + 1);
  const double value = (1.0 - b) * ((1.0 - a) * p + a * q) + b * ((1.0 - a) * r + a * s);
  return {value, (1.0 - b) * (q - p) + b * (s - r), (1.0 - a) * (r - p) + a * (s - q)};
}

// Add a value, and its weight of 1, to the four pixels of an `image (h, w, 2)` about a place.
inline void drop(View<float, 3> image, u32 row, u32 column, double weight, double value) {
  image(row, column, 0) += weight * value;
  image(row, column, 1) += weight;
}
inline void spread(View<float, 3> image, double u, double v, double value) {
  const u32 left = static_cast<u32>(u), top = static_cast<u32>(v);
  const double a = u - left, b = v - top;
  drop(image, top, left, (1.0 - b) * (1.0 - a), value);
  drop(image, top, left + 1, (1.0 - b) * a, value);
  drop(image, top + 1, left, b * (1.0 - a), value);
  drop(image, top + 1, left + 1, b * a, value);
}

// Which of the projected points (N,) land in an image: (n,) indices. Without a jump, which the processor would guess
// wrong; what follows reads pixels of these alone.
template <class T>
Array<u32, 1> landing(View<const double, 1> us, View<const double, 1> vs, View<const double, 1> zs, View<T, 2> image) {
  Array<u32, 1> found(us.size());
  const double right = image.shape[1] - 1.001, bottom = image.shape[0] - 1.001;
  const double *__restrict u = us.data, *__restrict v = vs.data, *__restrict z = zs.data;
  u32 *__restrict out = found.data;
  i64 n = 0, lands[BLOCK];
  for (i64 first = 0; first < us.size(); first += BLOCK) {
    const i64 count = std::min(BLOCK, us.size() - first);
    for (i64 k = 0; k < count; k++) {  // several points at a time
      const double x = u[first + k], y = v[first + k];
      lands[k] = (z[first + k] >= LEAST_DEPTH) & (x >= 0.0) & (y >= 0.0) & (x <= right) & (y <= bottom);
    }
    for (i64 k = 0; k < count; k++) out[n] = static_cast<u32>(first + k), n += lands[k];
  }
  return std::move(found).first(n);
}

// Which of the projected points (N,) an image sees: (n,) indices. It measured between `near` and `far (h, w)` there, 0
// where it measured nothing, and a depth z agrees within tolerance + growth z^2.
template <class T> Array<u32, 1> visible(View<const double, 1> us, View<const double, 1> vs, View<const double, 1> zs,
                                         View<T, 2> near, View<T, 2> far, double tolerance, double growth) {
  Array<u32, 1> found = landing(us, vs, zs, near);
  i64 n = 0;
  for (i64 k = 0; k < found.size(); k++) {
    const u32 i = found(k);
    const double z = zs(i), slop = tolerance + growth * z * z;
    const Pixel at = nearest(us(i), vs(i));
    const double low = near(at.row, at.column), high = far(at.row, at.column);
    found(n) = i;
    n += (high > 0.0) & (z >= low - slop) & (z <= high + slop);
  }
  return std::move(found).first(n);
}

// The same for Python.
inline std::tuple<Array<double, 1>, Array<double, 1>, Array<double, 1>> project_points(View<const float, 2> points,
                                                                                      View<const double, 2> T,
                                                                                      std::array<double, 4> camera) {
  Places out = project(points, T, camera);
  return {std::move(out.x), std::move(out.y), std::move(out.z)};
}
inline bool lands_in(double u, double v, double z, View<const double, 2> image) { return lands(u, v, z, image); }
inline std::tuple<i64, i64> nearest_pixel(double u, double v) {
  const Pixel at = nearest(u, v);
  return {at.row, at.column};
}
inline std::tuple<double, double, double> between_pixels(View<const double, 2> image, double u, double v) {
  const Slopes found = between(image, u, v);
  return {found.value, found.u, found.v};
}

inline PyMethodDef METHODS[] = {
    binding::method<between_pixels>("between", "The bilinear value of an image (h, w) at a place, and its slopes."),
    binding::method<lands_in>("lands", "Whether a point is before the camera and between four pixels of an image."),
    binding::method<nearest_pixel>("nearest", "The row and the column of the pixel that a place is in."),
    binding::method<project_points>("project", "The pixels u, v and the depths z (N,) of points moved by T."),
    binding::method<spread>("spread", "Adds a value, and its weight, to the four pixels of an image about a place."),
    {nullptr, nullptr, 0, nullptr},
};
}  // namespace objreg::projection
