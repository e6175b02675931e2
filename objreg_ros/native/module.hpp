// SPDX-License-Identifier: Apache-2.0
// The module of one variant: plain.cpp, fast.cpp and checked.cpp define KERNELS, its name, and include this. Its
// attributes are the kernel files, each with the kernels that Python calls.
#include "binding.hpp"
#include "files.hpp"

#define TEXT_(x) #x
#define TEXT(x) TEXT_(x)
#define INIT_(x) PyInit_##x
#define INIT(x) INIT_(x)

namespace {
int fill(PyObject *module) {
  if (!objreg::binding::prepare()) return -1;
  if (PyModule_AddStringConstant(module, "sources", TEXT(SOURCES))) return -1;
  for (const auto &file : objreg::FILES) {
    PyObject *part = PyModule_New(file.name);
    if (!part || PyModule_AddFunctions(part, file.methods) || PyModule_AddObjectRef(module, file.name, part)) return -1;
    Py_DECREF(part);
  }
  return 0;
}
PyModuleDef_Slot slots[] = {{Py_mod_exec, reinterpret_cast<void *>(fill)}, {0, nullptr}};
PyModuleDef definition = {PyModuleDef_HEAD_INIT, TEXT(KERNELS), nullptr, 0, nullptr, slots, nullptr, nullptr, nullptr};
}  // namespace

PyMODINIT_FUNC INIT(KERNELS)() { return PyModuleDef_Init(&definition); }
