// The command lines of umbel_vulkan and umbel_vulkan_deform.
#pragma once

#include <string>

#include "frame.hpp"

namespace sample {

struct Options {
  std::string file;  ///< empty: a generated mesh
  std::string out = ".";
  uint32_t frames = 0;  ///< 0: eight pictures, or until the window is closed
  uint32_t instances = 1000, budget_mb = 64;
  bool headless = false, help = false, trace = false;
  RendererConfig renderer;
  DeviceOptions device;
  FrameInput input;  ///< all but its camera
};

extern const char* const kUsage;

/// Throws std::invalid_argument with a sentence.
Options parse_options(int argc, char** argv);

struct DeformOptions {
  std::string file;  ///< its finest level; empty: a generated mesh
  std::string out = ".";
  uint32_t frames = 60, max_triangles = 256, width = 640, height = 480;
  DeviceOptions device;
};

DeformOptions parse_deform_options(int argc, char** argv);

}  // namespace sample
