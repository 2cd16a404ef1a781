// Draws into a window until it is closed.
#pragma once

#include "options.hpp"
#include "scene.hpp"

namespace sample {

/// False where there is no display, or GLFW was not there when this was built; says so.
bool show_window(const Options& options, const Field& field);

}  // namespace sample
