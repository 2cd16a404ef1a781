// The settings that papers give names to.
#include <algorithm>
#include <string>

#include "umbel/bvh_presets.hpp"

namespace umbel::bvh {
namespace {

template <typename Value>
struct Named {
  std::string_view name;
  Value value;
};

template <typename Value, size_t kCount>
Value by_name(const Named<Value> (&presets)[kCount], std::string_view name, const char* what) {
  std::string names;
  for (const auto& preset : presets) {
    if (preset.name == name) return preset.value;
    names += (names.empty() ? "" : ", ") + std::string(preset.name);
  }
  throw Error(ErrorCode::kInvalidArgument, "there is no " + std::string(what) + " preset \"" +
                                               std::string(name) + "\"; the presets are " + names);
}

}  // namespace

KmeansConfig kmeans_preset(std::string_view name) {
  constexpr Named<KmeansConfig> kPresets[]{
      {"q1", {.clusters = 8, .candidates = 5, .iterations = 0}},
      {"q2", {.clusters = 8, .candidates = 5, .iterations = 2}},
      {"q3", {.clusters = 16, .candidates = 5, .iterations = 5}},
      {"q4", {.clusters = 32, .candidates = 20, .iterations = 10}},
      {"q5", {.clusters = 64, .candidates = 30, .iterations = 15}},
  };
  return by_name(kPresets, name, "k-means");
}

AacConfig aac_preset(std::string_view name) {
  constexpr Named<AacConfig> kPresets[]{
      {"fast", {.leaf_size = 4, .epsilon = 0.2f}},
      {"hq", {.leaf_size = 20, .epsilon = 0.1f}},
  };
  return by_name(kPresets, name, "AAC");
}

Config builder_preset(std::string_view name) {
  const size_t dash = std::min(name.find('-'), name.size());
  Config config;
  config.builder = builder_by_name(name.substr(0, dash));
  if (dash == name.size()) return config;
  const std::string_view settings = name.substr(dash + 1);
  if (config.builder == Builder::kKmeans)
    config.kmeans = kmeans_preset(settings);
  else if (config.builder == Builder::kAac)
    config.aac = aac_preset(settings);
  else
    throw Error(ErrorCode::kInvalidArgument, "there is no builder \"" + std::string(name) +
                                                 "\"; only kmeans and aac have presets");
  return config;
}

}  // namespace umbel::bvh
