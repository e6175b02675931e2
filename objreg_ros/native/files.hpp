// SPDX-License-Identifier: Apache-2.0
// The kernel files, by the names of the Python files that they stand beside.
#pragma once
#include "objreg_ros/bridge/camera/native/registered_depth.hpp"
#include "objreg_ros/bridge/messages/native/rvl.hpp"
#include "objreg_ros/keyframes/native/tracking.hpp"
#include "objreg_ros/keyframes/native/turn.hpp"

namespace objreg {
struct File {
  const char *name;
  PyMethodDef *methods;
};
const File FILES[] = {
    {"registered_depth", registered_depth::METHODS},
    {"rvl", rvl::METHODS},
    {"tracking", tracking::METHODS},
    {"turn", turn::METHODS},
};
}  // namespace objreg
