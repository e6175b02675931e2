// SPDX-License-Identifier: Apache-2.0
// The kernels of noise.py.
#pragma once
#include "objreg_ros/native/binding.hpp"

// Sums in the order written: a recording is the same on every processor.
#pragma GCC push_options
#pragma GCC optimize("no-associative-math", "no-reciprocal-math", "fp-contract=off")

namespace objreg::noise {
constexpr float JUMP_SHARE = 0.02f;  // neighbours whose depths differ by more than this share are an edge
constexpr i64 LATTICE_PX = 3;  // edges wander together over about as many pixels
constexpr i64 NOISE_CELL_Y = 3, NOISE_CELL_X = 6;  // rows and columns over which noise is alike
constexpr double WHITE_SHARE = 0.1;  // share of the noise's variance that differs from pixel to pixel
constexpr i64 BLOTCH_PX = 24;  // size of the holes in surfaces that reflect badly
constexpr i64 LATTICE_WIDTH = 8192;

// std::max and std::min, and below C's functions, so that all is compiled as above and inlined.
template <class T> inline T larger(T a, T b) { return b > a ? b : a; }
template <class T> inline T smaller(T a, T b) { return b < a ? b : a; }

// 64 well mixed bits of two numbers (the finaliser of splitmix64, Steele et al. 2014).
inline u64 mixed_bits(u64 a, u64 b) {
  u64 h = a * 0x9E3779B97F4A7C15u + b * 0xD1B54A32D192ED03u;
  h = (h ^ (h >> 30)) * 0xBF58476D1CE4E5B9u;
  h = (h ^ (h >> 27)) * 0x94D049BB133111EBu;
  return h ^ (h >> 31);
}

// A nearly normal number from 64 bits: the sum of four uniform ones (Irwin-Hall), standard deviation 1.
inline float normal(u64 bits) {
  constexpr u64 low = 0xFFFF;
  const u64 total = (bits & low) + ((bits >> 16) & low) + ((bits >> 32) & low) + (bits >> 48);
  return (static_cast<float>(static_cast<i32>(total)) * static_cast<float>(1 / 65535.0) - 2.0f) * 1.7320508f;
}

// A number 0..1 from the upper 24 of 64 bits.
inline float uniform(u64 bits) {
  return static_cast<float>(static_cast<i32>(bits >> 40)) * static_cast<float>(1 / 16777216.0);
}

// The normal number of a node of a lattice.
inline float node(u64 seed, i64 i, i64 j) { return normal(mixed_bits(seed, static_cast<u64>(i * LATTICE_WIDTH + j))); }

// A smooth random number of standard deviation about 1 at a pixel: bilinear between those of a lattice.
inline double wander(u64 seed, i64 y, i64 x) {
  const i64 i = y / LATTICE_PX, j = x / LATTICE_PX;
  const double a = static_cast<double>(y - i * LATTICE_PX) / LATTICE_PX;
  const double b = static_cast<double>(x - j * LATTICE_PX) / LATTICE_PX;
  const double g00 = node(seed, i, j), g01 = node(seed, i, j + 1);
  const double g10 = node(seed, i + 1, j), g11 = node(seed, i + 1, j + 1);
  return ((1.0 - a) * ((1.0 - b) * g00 + b * g01) + a * ((1.0 - b) * g10 + b * g11)) * 1.5;
}

// Lattice values for row y of smooth noise, one for each column of the lattice. Variance about 1.
inline void noise_row(u64 seed, i64 y, i64 cell_y, View<float, 1> out) {
  const i64 i = y / cell_y;
  const float a = static_cast<float>(y - i * cell_y) / static_cast<float>(cell_y);
  for (i64 j = 0; j < out.size(); j++) {
    const float low = node(seed, i, j), high = node(seed, i + 1, j);
    // linear interpolation in both directions takes 2/3 of the deviation away
    out(j) = ((1.0f - a) * low + a * high) * 1.5f;
  }
}

// The value of a noise row at column x.
inline float at_column(View<const float, 1> row, i64 x, i64 cell) {
  const i64 j = x / cell;
  const float b = static_cast<float>(x - j * cell) / static_cast<float>(cell);
  return (1.0f - b) * row(j) + b * row(j + 1);
}

// Mark the pixels of a row that the projector does not reach; `shift` is focal length times baseline. A point at column
// x lies in the projector's column x - shift / z. Going left, that column must fall; where it does not, something nearer
// and further right stands in the projector's ray.
inline void shadow_row(View<const float, 1> nearness, float shift, View<bool, 1> out) {
  float least = 1e9f;
  for (i64 x = nearness.size() - 1; x >= 0; x--) {
    const float column = static_cast<float>(x) - shift * nearness(x);
    out(x) = column > least + 0.5f;
    if (column < least) least = column;
  }
}

struct Surroundings {
  float low, high;
  double bend;
};

// Least and greatest 1/z two pixels away, and by how much 1/z bends here: a plane does not, however slanted.
inline Surroundings surroundings(View<const float, 2> nearness, i64 y, i64 x) {
  const i64 height = nearness.shape[0], width = nearness.shape[1];
  const float left = nearness(y, std::max<i64>(x - 2, 0)), right = nearness(y, std::min(x + 2, width - 1));
  const float above = nearness(std::max<i64>(y - 2, 0), x), below = nearness(std::min(y + 2, height - 1), x);
  const double twice = 2.0 * nearness(y, x);
  const float sideways = left + right, upright = above + below;
  return {smaller(smaller(left, right), smaller(above, below)),
          larger(larger(left, right), larger(above, below)),
          larger(::fabs(sideways - twice), ::fabs(upright - twice))};
}

// Where a pixel wanders to along an axis of `size` pixels: nearby.
inline i64 wandered(i64 from, double jitter, i64 size) {
  return std::min(std::max<i64>(from + static_cast<i64>(::rint(jitter)), 0), size - 1);
}

// The cosine between the ray (dx, dy, 1) and the normal of a face, from the face's plane in 1/z.
inline float facing(float nearest, View<const float, 1> plane, float fx, float fy, float dx, float dy) {
  const float a = plane(1) * fx, b = plane(2) * fy;
  const float c = nearest - a * dx - b * dy;
  return nearest / ::sqrtf((a * a + b * b + c * c) * (1.0f + dx * dx + dy * dy));
}

// Measure the rows y_first..y_last of `depth`. `numbers` are the parameters in order.
inline void sense(View<const float, 2> nearness, View<const i32, 2> triangle, View<const float, 2> inverse_depth,
                  View<const float, 1> loss, i64 y_first, i64 y_last, std::array<float, 4> camera,
                  std::array<float, 12> numbers, i64 first_seed, View<const float, 2> warp, View<float, 2> depth) {
  const auto [fx, fy, cx, cy] = camera;
  const auto [floor, growth, quantum, baseline, near, far, dropout, grazing, jitter, edge_dropout, mixed, bias] = numbers;
  const i64 height = nearness.shape[0], width = nearness.shape[1];
  const u64 seed = static_cast<u64>(first_seed);
  Array<bool, 1> shadow(width);
  Array<float, 1> smooth(width / NOISE_CELL_X + 2), blotch(width / BLOTCH_PX + 2);
  const float common = static_cast<float>(::sqrt(1.0 - WHITE_SHARE));
  const float single = static_cast<float>(::sqrt(WHITE_SHARE));
  for (i64 y = y_first; y < y_last; y++) {
    shadow_row(nearness.row(y), fx * baseline, shadow);
    noise_row(seed + 6, y, NOISE_CELL_Y, smooth);
    noise_row(seed + 7, y, BLOTCH_PX, blotch);
    const float dy = (static_cast<float>(y) - cy) / fy;
    for (i64 x = 0; x < width; x++) {
      depth(y, x) = 0.0f;
      float nearest = nearness(y, x);
      if (nearest <= 0.0f || shadow(x)) continue;
      const u64 at = static_cast<u64>(y * width + x);
      const u64 bits = mixed_bits(seed, at);
      const Surroundings around = surroundings(nearness, y, x);
      i64 yy = y, xx = x;
      if (around.bend > JUMP_SHARE * nearest && around.high - around.low > JUMP_SHARE * nearest) {
        const float luck = uniform(mixed_bits(seed + 3, at));
        xx = wandered(x, jitter * wander(seed + 1, y, x), width);
        yy = wandered(y, jitter * wander(seed + 2, y, x), height);
        if (luck < edge_dropout || nearness(yy, xx) <= 0.0f) continue;
        nearest = nearness(yy, xx);
        if (luck > 1.0f - mixed) {
          const float share = uniform(mixed_bits(seed + 4, at));
          nearest = 1.0f / (share / larger(around.low, 0.05f) + (1.0f - share) / around.high);
        }
      }
      const i64 f = triangle(yy, xx);
      const float dx = (static_cast<float>(x) - cx) / fx;
      const float cosine = facing(nearness(yy, xx), inverse_depth.row(f), fx, fy, dx, dy);
      const float lost = dropout + larger(0.0f, (grazing - cosine) * 5.0f);
      if (uniform(mixed_bits(seed + 5, at)) < lost) continue;
      if (loss(f) > 0.0f) {  // in blotches: the logistic curve makes normal numbers nearly uniform
        const float level = at_column(blotch, x, BLOTCH_PX) + 0.4f * normal(mixed_bits(seed + 8, at));
        if (1.0f / (1.0f + ::expf(-1.6f * level)) < loss(f)) continue;
      }
      float z = 1.0f / nearest;
      const float error = common * at_column(smooth, x, NOISE_CELL_X) + single * normal(bits);
      const float beyond = z - 0.4f;
      z = z * (1.0f + bias) + warp(y, x) * z * z + error * (floor + growth * beyond * beyond);
      if (quantum > 0.0f)  // equal steps of disparity, that is of 1/z
        z = 1.0f / (larger(::rintf(1.0f / (z * quantum)), 1.0f) * quantum);
      if (near <= z && z <= far) depth(y, x) = z;
    }
  }
}
#pragma GCC pop_options

inline PyMethodDef METHODS[] = {
    binding::method<sense>("sense", "Measure rows of an image."),
    {nullptr, nullptr, 0, nullptr},
};
}  // namespace objreg::noise
