// SPDX-License-Identifier: Apache-2.0
// The kernels of cells.py.
#pragma once
#include "objreg_ros/native/binding.hpp"

namespace objreg::cells {
constexpr i64 REACH = 3;             // cells from the middle of a gradient to its ends
constexpr i64 RING = 8;               // rows that a gradient needs at once, or more
constexpr float MIN_COSINE = 0.1f;  // a surface seen flatter than this is not trusted with a larger area

// A row of cells of 2 x 2 pixels.
inline void halve_row(const float *__restrict upper, const float *__restrict lower, i64 width, float z_min, float far,
                      float a, float b, float *__restrict cells) {
  constexpr float beyond = std::numeric_limits<float>::infinity();
  for (i64 j = 0; j < width; j++) {
    float p = upper[2 * j], q = upper[2 * j + 1], r = lower[2 * j], s = lower[2 * j + 1];
    p = p > z_min ? p : beyond, q = q > z_min ? q : beyond;
    r = r > z_min ? r : beyond, s = s > z_min ? s : beyond;
    const float near = std::min(std::min(p, q), std::min(r, s));
    const float limit = std::min(near + a + b * near * near, far);
    const float total =
        ((p < limit ? p : 0.0f) + (q < limit ? q : 0.0f)) + ((r < limit ? r : 0.0f) + (s < limit ? s : 0.0f));
    const i32 count =
        ((p < limit ? -1 : 0) + (q < limit ? -1 : 0)) + ((r < limit ? -1 : 0) + (s < limit ? -1 : 0));
    cells[j] = total / std::max(static_cast<float>(-count), 1.0f);
  }
}

// `shrink` for cells of 2 x 2 pixels, as they are at 640 x 480, in one pass.
inline void halve(View<const float, 2> depth, float z_min, View<const float, 1> far, float a, float b,
                  View<float, 2> out) {
  const i64 w = out.shape[1];
  for (i64 i = 0; i < out.shape[0]; i++)
    halve_row(depth.row(2 * i).cut(0, 2 * w).data, depth.row(2 * i + 1).cut(0, 2 * w).data, w, z_min, far(i), a, b,
              out.row(i).data);
}

inline void narrow(const float *__restrict row, i64 step, i64 width, float z_min, float *__restrict near) {
  for (i64 j = 0; j < width; j++) {
    const float z = row[j * step];
    near[j] = (z > z_min) & (z < near[j]) ? z : near[j];
  }
}
inline void add_up(const float *__restrict row, i64 step, i64 width, float z_min, const float *__restrict near,
                   float *__restrict total, float *__restrict count) {
  for (i64 j = 0; j < width; j++) {
    const float z = row[j * step];
    const bool good = (z > z_min) & (z < near[j]);
    total[j] += good ? z : 0.0f;
    count[j] += good ? 1.0f : 0.0f;
  }
}

// Each cell: the mean of the pixels within a depth step of its block's nearest one, nearer than `far` (h,). STEP is the
// step, or 0 for any.
template <i64 STEP>
void shrink_by(View<const float, 2> depth, i64 any, float z_min, View<const float, 1> far, float a, float b,
               View<float, 2> out) {
  const i64 h = out.shape[0], w = out.shape[1], step = STEP ? STEP : any;
  Array<float, 1> near(w), total(w), count(w);
  float *__restrict reach = near.data;
  for (i64 i = 0; i < h; i++) {
    near.fill(far(i)), total.fill(0.0f), count.fill(0.0f);
    for (i64 v = i * step; v < i * step + step; v++)
      for (i64 du = 0; du < step; du++) narrow(depth.row(v).cut(du, w * step).data, step, w, z_min, reach);
    const float limit = far(i);
    for (i64 j = 0; j < w; j++) reach[j] = std::min(reach[j] + a + b * reach[j] * reach[j], limit);
    for (i64 v = i * step; v < i * step + step; v++)
      for (i64 du = 0; du < step; du++)
        add_up(depth.row(v).cut(du, w * step).data, step, w, z_min, reach, total.data, count.data);
    for (i64 j = 0; j < w; j++) out(i, j) = total(j) / std::max(count(j), 1.0f);
  }
}

inline void shrink(View<const float, 2> depth, i64 step, float z_min, View<const float, 1> far, float a, float b,
                   View<float, 2> out) {
  if (step == 1) shrink_by<1>(depth, step, z_min, far, a, b, out);
  else if (step == 2) halve(depth, z_min, far, a, b, out);
  else if (step == 4) shrink_by<4>(depth, step, z_min, far, a, b, out);
  else shrink_by<0>(depth, step, z_min, far, a, b, out);
}

// The mean of a cell of inverse depth `c` and of those of its two neighbours that are within `limit` of it.
inline float mean_of_near(float c, float p, float q, float limit) {
  const bool g = std::abs(p - c) < limit, k = std::abs(q - c) < limit;
  const float share = g ? (k ? 1.0f / 3.0f : 0.5f) : (k ? 0.5f : 1.0f);
  return (c + (g ? p : 0.0f) + (k ? q : 0.0f)) * share;
}

// The inverse depth of a row, and its means with what is left and right of it.
inline void invert_row(const float *__restrict depth, i64 width, float a, float b, float *__restrict near,
                       float *__restrict flat) {
  for (i64 j = 0; j < width; j++) near[j] = depth[j] > 0.0f ? 1.0f / depth[j] : 0.0f;
  for (i64 j = 1; j < width - 1; j++) {
    const float c = near[j];
    flat[j] = mean_of_near(c, near[j - 1], near[j + 1], a * c * c + b);
  }
}

// A row's means with what is above and below it.
inline void smooth_row(const float *__restrict above, const float *__restrict here, const float *__restrict below,
                       i64 width, float a, float b, float *__restrict upright) {
  for (i64 j = 1; j < width - 1; j++) {
    const float c = here[j];
    upright[j] = mean_of_near(c, above[j], below[j], a * c * c + b);
  }
}

// The gradient of a line from its two halves: only the flatter one where it bends.
inline float gradient(float f, float g, float limit) {
  const float flatter = std::abs(f) < std::abs(g) ? f : g;
  return std::abs(f - g) < limit ? 0.5f * (f + g) : flatter;
}

inline void normals_row(const float *__restrict near, const float *__restrict upright, const float *__restrict up,
                        const float *__restrict flat, const float *__restrict down, const float *__restrict x, float y,
                        i64 width, float fx, float fy, float a, float b, float *__restrict out_x,
                        float *__restrict out_y, float *__restrict out_z) {
  for (i64 j = REACH; j < width - REACH; j++) {
    const float c = near[j], limit = a * c * c + b, steep = 3.0f * limit;
    const float across = gradient(upright[j + REACH] - upright[j], upright[j] - upright[j - REACH], limit);
    const float along = gradient(down[j] - flat[j], flat[j] - up[j], limit);
    const bool known = (c > 0.0f) & (std::abs(across) < steep) & (std::abs(along) < steep);
    const float n_x = across * fx, n_y = along * fy, n_z = c - x[j] * n_x - y * n_y;
    const float length = -1.0f / std::sqrt(std::max(n_x * n_x + n_y * n_y + n_z * n_z, 1e-12f));
    out_x[j] = known ? n_x * length : 0.0f;
    out_y[j] = known ? n_y * length : 0.0f;
    out_z[j] = known ? n_z * length : 0.0f;
  }
}

// Fill `normals`, which is 0 before: gradients over REACH cells to both sides, of lines that are the mean of three;
// `fx` and `fy` in cells. Where a line bends or breaks in its middle only its flatter half counts, so that edges stay
// sharp. A depth step of a + b z² is one of a / z² + b in inverse depth.
inline void normals(View<const float, 2> depth, View<const float, 1> x, View<const float, 1> y, double fx, double fy,
                    float a, float b, View<float, 3> normals) {
  const i64 h = depth.shape[0], w = depth.shape[1];
  if (std::min(h, w) <= 2 * REACH) return;
  const float scale_x = static_cast<float>(fx / REACH), scale_y = static_cast<float>(fy / REACH);
  // Of the last rows only, which stay in the processor's cache; the means are 0 at the rim of the image.
  auto near = zeros<float, 2>(RING, w), flat = zeros<float, 2>(RING, w);
  auto upright = zeros<float, 1>(w);
  const auto n_x = normals.row(0), n_y = normals.row(1), n_z = normals.row(2);
  for (i64 last = 0; last < h; last++) {
    invert_row(depth.row(last).data, w, a, b, near.row(last % RING).data, flat.row(last % RING).data);
    if (last == 0 || last == h - 1) flat.row(last % RING).fill(0.0f);
    const i64 i = last - REACH;
    if (i < REACH) continue;
    const float *here = near.row(i % RING).data;
    smooth_row(near.row((i - 1) % RING).data, here, near.row((i + 1) % RING).data, w, a, b, upright.data);
    normals_row(here, upright.data, flat.row((i - REACH) % RING).data, flat.row(i % RING).data,
                flat.row(last % RING).data, x.data, y(i), w, scale_x, scale_y, a, b, n_x.row(i).data, n_y.row(i).data,
                n_z.row(i).data);
  }
}

inline PyMethodDef METHODS[] = {
    binding::method<shrink>("shrink", "Fill the cells of a depth image."),
    binding::method<normals>("normals", "Fill the normals of the cells."),
    {nullptr, nullptr, 0, nullptr},
};
}  // namespace objreg::cells
