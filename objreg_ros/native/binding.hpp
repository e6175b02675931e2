// SPDX-License-Identifier: Apache-2.0
// Functions of views, numbers and tuples for Python, by Python's stable interface alone (3.11 and later): no other
// library. Another type of an array or another number of axes is a TypeError. An array is taken as it is; only one that
// is read and whose last axis has gaps is copied first. What a function makes goes to numpy without a copy.
#pragma once
#define Py_LIMITED_API 0x030B0000
#define PY_SSIZE_T_CLEAN
#include <Python.h>

#include <cstring>
#include <new>
#include <type_traits>

#include "array.hpp"

namespace objreg::binding {
struct Refused {};  // a Python error is set

template <class T> constexpr const char *format() {
  if constexpr (std::is_same_v<T, bool>) return "?";
  else if constexpr (std::is_floating_point_v<T>) return sizeof(T) == 4 ? "f" : "d";
  else if constexpr (std::is_signed_v<T>) return sizeof(T) == 1 ? "b" : sizeof(T) == 2 ? "h" : sizeof(T) == 4 ? "i" : "l";
  else return sizeof(T) == 1 ? "B" : sizeof(T) == 2 ? "H" : sizeof(T) == 4 ? "I" : "L";
}
inline char kind(char code) {
  return code == '?' ? '?' : std::strchr("fdeg", code) ? 'f' : std::strchr("bhilqn", code) ? 'i' : 'u';
}
inline char kind_of(const char *text) { return text ? kind(text[std::strchr("<=@", text[0]) != nullptr]) : 'u'; }

template <class T> struct Argument {  // a number
  T value;
  explicit Argument(PyObject *o) {
    if constexpr (std::is_same_v<T, bool>) value = PyObject_IsTrue(o) == 1;
    else if constexpr (std::is_floating_point_v<T>) value = static_cast<T>(PyFloat_AsDouble(o));
    else value = static_cast<T>(PyLong_AsLongLong(o));
    if (PyErr_Occurred()) throw Refused();
  }
};
template <class T, int N> struct Argument<View<T, N>> {
  using Item = std::remove_const_t<T>;
  Py_buffer held{};
  View<T, N> value;
  std::unique_ptr<Item[]> compact;
  explicit Argument(PyObject *o) {
    constexpr int flags = PyBUF_FORMAT | PyBUF_STRIDES | (std::is_const_v<T> ? 0 : PyBUF_WRITABLE);
    if (PyObject_GetBuffer(o, &held, flags)) throw Refused();
    const char expected = kind(*format<Item>());
    bool fits = held.ndim == N && held.itemsize == sizeof(T) && kind_of(held.format) == expected;
    bool gaps = false;
    i64 total = 1;
    for (int k = 0; fits && k < N; k++) value.shape[k] = held.shape[k], total *= held.shape[k];
    for (int k = 0; fits && k < N; k++) {
      const i64 bytes = held.strides[k], size = sizeof(T);
      value.stride[k] = bytes / size;
      if (total > 0 && held.shape[k] > 1) gaps |= bytes % size != 0 || (k == N - 1 && bytes != size);
    }
    value.data = static_cast<T *>(held.buf);
    if (fits && gaps && std::is_const_v<T>) copy(total);
    else if (!fits || gaps) {
      PyErr_Format(PyExc_TypeError, "expected an array of %d axes, '%c%d', the last without gaps, got %d of '%s%d'", N, expected,
                   int(sizeof(T)), held.ndim, held.format ? held.format : "B", int(held.itemsize));
      PyBuffer_Release(&held);
      throw Refused();
    }
  }
  void copy(i64 total) {
    compact.reset(new Item[total]);
    i64 at[N] = {}, step = 1;
    for (i64 n = 0; n < total; n++) {
      const char *from = static_cast<const char *>(held.buf);
      for (int k = 0; k < N; k++) from += at[k] * held.strides[k];
      std::memcpy(&compact[n], from, sizeof(T));
      for (int k = N - 1; k >= 0 && ++at[k] == held.shape[k]; k--) at[k] = 0;
    }
    for (int k = N - 1; k >= 0; k--) value.stride[k] = step, step *= held.shape[k];
    value.data = compact.get();
  }
  ~Argument() { PyBuffer_Release(&held); }
  Argument(const Argument &) = delete;
};
inline PyObject *item(PyObject *tuple, Py_ssize_t at) {
  PyObject *found = PyTuple_GetItem(tuple, at);  // borrowed
  if (!found) throw Refused();
  return found;
}
template <class... A> struct Argument<std::tuple<A...>> {
  std::tuple<Argument<A>...> parts;
  std::tuple<A...> value;
  explicit Argument(PyObject *o) : Argument(o, std::index_sequence_for<A...>()) {}
  template <std::size_t... I>
  Argument(PyObject *o, std::index_sequence<I...>) : parts{item(o, I)...}, value{std::get<I>(parts).value...} {}
};
template <class T, std::size_t N> struct Argument<std::array<T, N>> {
  std::array<T, N> value;
  explicit Argument(PyObject *o) {
    for (std::size_t k = 0; k < N; k++) value[k] = Argument<T>(item(o, k)).value;
  }
};

struct Owned {  // what a kernel made: a Python object with the memory of an Array
  PyObject_HEAD
  void *data;
  void (*release)(void *);
  const char *format;
  Py_ssize_t itemsize;
  int axes;
  Py_ssize_t shape[4], strides[4];
};
inline PyObject *owned_type = nullptr, *as_array = nullptr;

inline int get_buffer(PyObject *self, Py_buffer *view, int) {
  auto *of = reinterpret_cast<Owned *>(self);
  Py_ssize_t items = 1;
  for (int k = 0; k < of->axes; k++) items *= of->shape[k];
  view->buf = of->data, view->obj = self, view->len = items * of->itemsize, view->itemsize = of->itemsize;
  view->readonly = 0, view->ndim = of->axes, view->format = const_cast<char *>(of->format);
  view->shape = of->shape, view->strides = of->strides, view->suboffsets = nullptr, view->internal = nullptr;
  Py_INCREF(self);
  return 0;
}
inline void free_owned(PyObject *self) {
  auto *of = reinterpret_cast<Owned *>(self);
  PyTypeObject *type = Py_TYPE(self);
  if (of->data) of->release(of->data);
  reinterpret_cast<freefunc>(PyType_GetSlot(type, Py_tp_free))(self);
  Py_DECREF(type);
}
inline bool prepare() {  // once a process
  static PyType_Slot slots[] = {{Py_tp_dealloc, reinterpret_cast<void *>(free_owned)},
                                {Py_bf_getbuffer, reinterpret_cast<void *>(get_buffer)},
                                {0, nullptr}};
  static PyType_Spec spec = {"objreg_ros.native.Owned", sizeof(Owned), 0, Py_TPFLAGS_DEFAULT, slots};
  PyObject *numpy = PyImport_ImportModule("numpy");
  if (!numpy) return false;
  as_array = PyObject_GetAttrString(numpy, "asarray");
  Py_DECREF(numpy);
  owned_type = PyType_FromSpec(&spec);
  return as_array && owned_type;
}

inline PyObject *given(double v) { return PyFloat_FromDouble(v); }
inline PyObject *given(float v) { return PyFloat_FromDouble(v); }
inline PyObject *given(bool v) { return PyBool_FromLong(v); }
inline PyObject *given(i64 v) { return PyLong_FromLongLong(v); }
inline PyObject *given(i32 v) { return PyLong_FromLong(v); }
template <class T, int N> PyObject *given(Array<T, N> &&made) {
  PyObject *self = PyType_GenericAlloc(reinterpret_cast<PyTypeObject *>(owned_type), 0);
  if (!self) throw Refused();
  auto *of = reinterpret_cast<Owned *>(self);
  of->release = [](void *data) { delete[] static_cast<T *>(data); };
  of->format = format<T>(), of->itemsize = sizeof(T), of->axes = N;
  for (int k = 0; k < N; k++) of->shape[k] = made.shape[k], of->strides[k] = made.stride[k] * Py_ssize_t{sizeof(T)};
  of->data = made.own.release();
  PyObject *array = PyObject_CallFunctionObjArgs(as_array, self, nullptr);
  Py_DECREF(self);
  if (!array) throw Refused();
  return array;
}
template <class... R> PyObject *given(std::tuple<R...> &&made) {
  PyObject *tuple = PyTuple_New(sizeof...(R));
  Py_ssize_t at = 0;
  std::apply([&](auto &&...part) { (PyTuple_SetItem(tuple, at++, given(std::move(part))), ...); }, std::move(made));
  return tuple;
}

template <class R, class... A, std::size_t... I>
PyObject *called(R (*f)(A...), PyObject *const *args, std::index_sequence<I...>) {
  std::tuple<Argument<A>...> in{args[I]...};
  const auto run = [&]() -> R {  // without the interpreter's lock
    struct Unlocked {
      PyThreadState *state = PyEval_SaveThread();
      ~Unlocked() { PyEval_RestoreThread(state); }
    } unlocked;
    return f(std::get<I>(in).value...);
  };
  if constexpr (std::is_void_v<R>) {
    run();
    Py_RETURN_NONE;
  } else {
    return given(run());
  }
}
template <class R, class... A> PyObject *call(R (*f)(A...), PyObject *const *args, Py_ssize_t n) {
  if (n != sizeof...(A)) return PyErr_Format(PyExc_TypeError, "expected %d arguments, got %d", int(sizeof...(A)), int(n));
  try {
    return called(f, args, std::index_sequence_for<A...>());
  } catch (const Refused &) {
    return nullptr;
  } catch (const std::out_of_range &error) {
    PyErr_SetString(PyExc_IndexError, error.what());
    return nullptr;
  } catch (const std::bad_alloc &) {
    return PyErr_NoMemory();
  }
}
template <auto F> PyMethodDef method(const char *name, const char *help) {
  const auto entry = +[](PyObject *, PyObject *const *args, Py_ssize_t n) { return call(F, args, n); };
  return {name, reinterpret_cast<PyCFunction>(reinterpret_cast<void (*)()>(entry)), METH_FASTCALL, help};
}
}  // namespace objreg::binding
