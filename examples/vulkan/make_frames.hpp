// The way of making pictures that the options ask for.
#pragma once

#include <memory>

#include "options.hpp"
#include "renderer.hpp"
#include "scene.hpp"
#include "traced_renderer.hpp"

namespace sample {

inline std::unique_ptr<FrameMaker> make_frames(const Device& device, const Field& field,
                                               const Options& options,
                                               const RendererConfig& config) {
  if (options.trace) {
    return std::make_unique<TracedRenderer>(device, field.asset, field.instances(), config);
  }
  return std::make_unique<Renderer>(device, field.asset, field.instances(), config);
}

}  // namespace sample
