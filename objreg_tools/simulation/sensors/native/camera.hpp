// SPDX-License-Identifier: Apache-2.0
// The kernel of camera.py.
#pragma once
#include "objreg_ros/native/binding.hpp"
#include "objreg_tools/simulation/sensors/native/noise.hpp"

#pragma GCC push_options  // as in noise.hpp
#pragma GCC optimize("no-associative-math", "no-reciprocal-math", "fp-contract=off")

namespace objreg::camera {
// Rows of `raw` light (sqrt-encoded) to sRGB-like bytes with noise; highlights roll off softly.
inline void develop(View<const u16, 3> raw, i64 y_first, i64 y_last, View<const float, 1> gains, float shot, float read,
                    float vignetting, i64 seed, View<u8, 3> rgb) {
  constexpr float knee = 0.8f;
  const i64 height = raw.shape[0], width = raw.shape[1];
  const float reach = 4.0f / static_cast<float>(width * width + height * height);
  const double middle_y = 0.5 * height, middle_x = 0.5 * width;
  const float dark = read * read, bright = shot * shot;
  for (i64 y = y_first; y < y_last; y++) {
    const double dy = y - middle_y;
    for (i64 x = 0; x < width; x++) {
      const double dx = x - middle_x;
      const double shade = 1.0 - vignetting * (dx * dx + dy * dy) * reach;
      for (i64 c = 0; c < 3; c++) {
        double value = static_cast<float>(raw(y, x, c)) * gains(c) * shade;
        if (value > knee) {
          const double over = (value - knee) * 5.0;
          value = knee + 0.2f * over / (1.0 + over);
        }
        const double sigma = ::sqrt(dark + bright * value);
        value += sigma * noise::normal(noise::mixed_bits(seed, 3 * (y * width + x) + c));
        const double level = value * 255.0 + 0.5;
        rgb(y, x, c) = static_cast<u8>(level > 0.0 ? noise::smaller(level, 255.0) : 0.0);
      }
    }
  }
}
#pragma GCC pop_options

inline PyMethodDef METHODS[] = {
    binding::method<develop>("develop", "Rows of light to bytes with noise."),
    {nullptr, nullptr, 0, nullptr},
};
}  // namespace objreg::camera
