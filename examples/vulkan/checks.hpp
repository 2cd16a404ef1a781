// The sample's tests, a file each; check.cpp runs them.
#pragma once

#include <filesystem>
#include <string>
#include <umbel/umbel.hpp>

#include "renderer.hpp"

namespace sample {

/// Prints what was found, and counts what is not good.
void expect(bool good, const std::string& what);

/// Draws until nothing is missing, and then once more. False if pages do not arrive.
bool draw_whole(FrameMaker& renderer, const FrameInput& input);

/// Mesh shaders and vertex pulling draw the same picture.
void check_paths(const Device& device, const umbel::Asset& asset);

/// With and without: the same pixels; fewer clusters where much is behind something.
void check_occlusion(const Device& device, const umbel::Asset& asset,
                     const std::filesystem::path& folder);

/// The same picture as drawn and as by Umbel's tracer; structures are built where the cut changed.
void check_traced(const Device& device, const umbel::Asset& asset,
                  const std::filesystem::path& folder);

/// Clusters of a deforming mesh by compute shaders: the processor's bytes; any policy's picture.
void check_deform(const Device& device);

/// Drags turn and move the camera as far as they say; keys change what they say.
void check_controls();

}  // namespace sample
