// SPDX-License-Identifier: Apache-2.0
// Arrays as the kernels see them: a view whose last axis is contiguous, and an array that a kernel makes for itself.
#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <stdexcept>
#include <string>
#include <tuple>
#include <utility>

namespace objreg {
using u8 = std::uint8_t;
using u16 = std::uint16_t;
using u32 = std::uint32_t;
using u64 = std::uint64_t;
using i32 = std::int32_t;
using i64 = std::int64_t;

#ifdef OBJREG_CHECKED
inline void check(i64 at, i64 size) {
  if (at < 0 || at >= size) throw std::out_of_range("index " + std::to_string(at) + " of " + std::to_string(size));
}
inline void check_slice(i64 first, i64 last, i64 size) {
  if (first < 0 || last < first || last > size)
    throw std::out_of_range("slice " + std::to_string(first) + ":" + std::to_string(last) + " of " + std::to_string(size));
}
#else
inline void check(i64, i64) {}
inline void check_slice(i64, i64, i64) {}
#endif

template <class T, int N> struct View {
  T *data;
  i64 shape[N], stride[N];  // in elements; the stride of the last axis is 1

  i64 size() const { return shape[0]; }
  T &operator()(i64 i) const {
    static_assert(N == 1);
    check(i, shape[0]);
    return data[i];
  }
  T &operator()(i64 i, i64 j) const {
    static_assert(N == 2);
    check(i, shape[0]), check(j, shape[1]);
    return data[i * stride[0] + j];
  }
  T &operator()(i64 i, i64 j, i64 k) const {
    static_assert(N == 3);
    check(i, shape[0]), check(j, shape[1]), check(k, shape[2]);
    return data[i * stride[0] + j * stride[1] + k];
  }
  View<T, N - 1> row(i64 i) const {  // a[i]
    check(i, shape[0]);
    View<T, N - 1> out;
    out.data = data + i * stride[0];
    for (int k = 1; k < N; k++) out.shape[k - 1] = shape[k], out.stride[k - 1] = stride[k];
    return out;
  }
  View cut(i64 first, i64 last) const {  // a[first:last]
    check_slice(first, last, shape[0]);
    View out = *this;
    out.data += first * (N == 1 ? 1 : stride[0]);
    out.shape[0] = last - first;
    return out;
  }
  View from(i64 first) const { return cut(first, shape[0]); }  // a[first:]
  void fill(T value) const {                                   // of an array without gaps
    i64 total = 1;
    for (int k = 0; k < N; k++) total *= shape[k];
    std::fill_n(data, total, value);
  }
  operator View<const T, N>() const {
    View<const T, N> out;
    out.data = data;
    for (int k = 0; k < N; k++) out.shape[k] = shape[k], out.stride[k] = stride[k];
    return out;
  }
};

// Memory of its own, not filled, as np.empty: `Array<float, 2> a(h, w)`; `zeros<float, 2>(h, w)` is np.zeros.
template <class T, int N> struct Array : View<T, N> {
  std::unique_ptr<T[]> own;

  Array() : Array(std::make_index_sequence<N>()) {}
  template <class... I, class = std::enable_if_t<sizeof...(I) == N>> explicit Array(I... n) {
    i64 sizes[N] = {static_cast<i64>(n)...}, total = 1;
    for (int k = N - 1; k >= 0; k--) {
      check(0, sizes[k] + 1);
      this->shape[k] = sizes[k], this->stride[k] = total, total *= sizes[k];
    }
    own.reset(new T[total > 0 ? total : 1]);
    this->data = own.get();
  }
  Array(Array &&) = default;
  Array &operator=(Array &&) = default;
  // a[:n], which keeps the memory of all of it.
  Array first(i64 n) && {
    check_slice(0, n, this->shape[0]);
    this->shape[0] = n;
    return std::move(*this);
  }

 private:
  template <std::size_t... I> explicit Array(std::index_sequence<I...>) : Array((static_cast<void>(I), i64{0})...) {}
};

template <class T, int N, class... I> Array<T, N> full(T value, I... n) {
  Array<T, N> out(n...);
  out.fill(value);
  return out;
}
template <class T, int N, class... I> Array<T, N> zeros(I... n) { return full<T, N>(T{}, n...); }

// a // b and a % b of Python, which round down.
inline i64 floor_div(i64 a, i64 b) { return a / b - ((a % b != 0) & ((a < 0) != (b < 0))); }
inline i64 floor_mod(i64 a, i64 b) { return a - b * floor_div(a, b); }
}  // namespace objreg
