// SPDX-License-Identifier: Apache-2.0
// The kernel of rvl.py.
#pragma once
#include "objreg_ros/native/binding.hpp"

namespace objreg::rvl {
constexpr int MOST_NIBBLES = 11;  // of a number of 32 bits
constexpr i64 TRUNCATED = -1, TOO_LONG = -2;

struct Number {
  i64 value, at;
};

// The number at a nibble, and the nibble behind it; 0 and what is wrong where there is none.
inline Number number(View<const u32, 1> words, i64 at) {
  i64 value = 0;
  for (int k = 0; k < MOST_NIBBLES; k++) {
    if (at >> 3 >= words.size()) return {0, TRUNCATED};
    const u32 nibble = (words(at >> 3) >> (28 - 4 * (at & 7))) & 0xF;
    at++;
    value |= static_cast<i64>(nibble & 7) << (3 * k);
    if (nibble < 8) return {value, at};
  }
  return {0, TOO_LONG};
}

// Fill the pixels; 0, TRUNCATED or TOO_LONG. Each round takes two numbers off the stream, so it ends.
inline i64 unpack(View<const u32, 1> words, View<u16, 1> pixels) {
  i64 at = 0, done = 0, before = 0;
  while (done < pixels.size()) {
    const Number nothing = number(words, at);
    at = nothing.at;
    if (at < 0 || nothing.value > pixels.size() - done) return at < 0 ? at : TOO_LONG;
    done += nothing.value;
    const Number others = number(words, at);
    at = others.at;
    if (at < 0 || others.value > pixels.size() - done) return at < 0 ? at : TOO_LONG;
    for (i64 k = 0; k < others.value; k++) {
      const Number zigzag = number(words, at);
      at = zigzag.at;
      if (at < 0) return at;
      before = (before + ((zigzag.value >> 1) ^ -(zigzag.value & 1))) & 0xFFFF;
      pixels(done) = static_cast<u16>(before);
      done++;
    }
  }
  return 0;
}

inline PyMethodDef METHODS[] = {
    binding::method<unpack>("unpack", "Fill the pixels; 0, TRUNCATED or TOO_LONG."),
    {nullptr, nullptr, 0, nullptr},
};
}  // namespace objreg::rvl
