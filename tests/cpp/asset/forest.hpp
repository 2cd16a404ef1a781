// A scene of very many small things, as an asset with a tree of instances.
#pragma once

#include <cmath>
#include <random>

#include "asset/scratch.hpp"
#include "base/math.hpp"
#include "umbel/instance_tree.hpp"

namespace umbel::testing {

/// Upright, turned and scaled at random, side by side in the plane y = 0.
inline std::vector<Instance> forest(uint32_t count, uint32_t meshes, uint32_t seed = 1) {
  std::mt19937 random(seed);
  const auto uniform = [&](float low, float high) {
    return low + (high - low) * static_cast<float>(random() >> 8) * 0x1p-24f;
  };
  const float side = 3 * std::sqrt(static_cast<float>(count));
  std::vector<Instance> trees;
  for (uint32_t i = 0; i < count; ++i) {
    const float angle = uniform(0, 6.2831853f), scale = uniform(0.8f, 1.2f);
    const float c = scale * std::cos(angle), s = scale * std::sin(angle);
    trees.push_back(
        {i % meshes, {{c, 0, s, uniform(0, side), 0, scale, 0, 0, -s, 0, c, uniform(0, side)}}});
  }
  return trees;
}

/// Of two meshes.
inline std::filesystem::path forest_asset(const Scratch& scratch, uint32_t count,
                                          const std::string& name = "forest.umbel") {
  const lod::Dag sphere = lod::build(shapes::sphere(4).view());
  const lod::Dag torus = lod::build(shapes::torus(48, 24).view());
  AssetContents contents;
  contents.meshes = {&sphere, &torus};
  contents.instances = forest(count, 2);
  contents.most_listed_instances = 100;
  write_asset(scratch / name, contents);
  return scratch / name;
}

}  // namespace umbel::testing
