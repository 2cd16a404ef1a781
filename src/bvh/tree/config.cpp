// Ranges of the configuration's fields, and the presets.
#include "bvh/tree/config.hpp"

#include <cmath>
#include <string>

#include "base/printed.hpp"

namespace umbel::bvh {
namespace {

void check_range(const char* name, double value, double low, double high) {
  if (value >= low && value <= high) return;
  throw Error(ErrorCode::kInvalidArgument, std::string(name) + " is " + printed(value) +
                                               ", but must be from " + printed(low) + " to " +
                                               printed(high));
}

void check_enum(const char* name, uint32_t value, uint32_t count) {
  if (value < count) return;
  throw Error(ErrorCode::kInvalidArgument, std::string(name) + " is " + std::to_string(value) +
                                               ", but its values are 0 to " +
                                               std::to_string(count - 1));
}

void check_costs(const CostModel& cost, bool (*is_right)(float), const char* needed) {
  const auto check = [&](const char* name, float value) {
    if (is_right(value) && std::isfinite(value)) return;
    throw Error(ErrorCode::kInvalidArgument,
                std::string(name) + " is " + printed(value) + ", but must be " + needed);
  };
  check("cost.traversal", cost.traversal);
  check("cost.intersection", cost.intersection);
}

}  // namespace

void check_cost(const CostModel& cost) {
  check_costs(cost, [](float c) { return c > 0; }, "positive and finite");
}

void check_measure(const CostModel& cost) {
  check_costs(cost, [](float c) { return c >= 0; }, "finite and not negative");
}

void check_config(const Config& c, size_t primitives) {
  check_enum("builder", static_cast<uint32_t>(c.builder), 11);
  check_enum("invalid", static_cast<uint32_t>(c.invalid), 2);
  check_enum("kmeans.distance", static_cast<uint32_t>(c.kmeans.distance), 2);
  check_cost(c.cost);
  check_range("max_leaf_size", c.max_leaf_size, 1, 255);
  check_range("max_depth", c.max_depth, 8, kDeepest);
  check_range("bins", c.bins, 4, 256);
  check_range("spatial_budget", double(c.spatial_budget), 0, 4);
  check_range("spatial_overlap", double(c.spatial_overlap), 0, 1);
  if (c.morton_bits != 30 && c.morton_bits != 60 && c.morton_bits != 63)
    throw Error(ErrorCode::kInvalidArgument,
                "morton_bits is " + std::to_string(c.morton_bits) + ", but must be 30, 60 or 63");
  check_range("hlbvh_bits", c.hlbvh_bits, 3, 30);
  check_range("ploc_radius", c.ploc_radius, 1, 128);
  check_range("ploc_sweep", c.ploc_sweep, 0, 255);
  if (c.atrbvh_bits != 0) check_range("atrbvh_bits", c.atrbvh_bits, 3, 30);
  check_range("treelet_size", c.treelet_size, 3, 15);
  check_range("treelet_rounds", c.treelet_rounds, 1, 16);
  check_range("reinsertion_rounds", c.reinsertion_rounds, 0, 64);
  check_range("kmeans.clusters", c.kmeans.clusters, 2, 1024);
  check_range("kmeans.candidates", c.kmeans.candidates, 1, 64);
  check_range("kmeans.iterations", c.kmeans.iterations, 0, 100);
  check_range("kmeans.forwarded_clusters", c.kmeans.forwarded_clusters, 0, 64);
  check_range("aac.leaf_size", c.aac.leaf_size, 2, 128);
  check_range("aac.epsilon", double(c.aac.epsilon), 0, 0.5);

  double references = double(primitives);
  if (c.builder == Builder::kSpatial) references *= 1.0 + double(c.spatial_budget);
  const uint32_t needed = balanced_depth(static_cast<size_t>(std::ceil(references)));
  if (needed > c.max_depth)
    throw Error(ErrorCode::kInvalidArgument, "max_depth is " + std::to_string(c.max_depth) +
                                                 ", but " + std::to_string(primitives) +
                                                 " primitives need " + std::to_string(needed));
}

}  // namespace umbel::bvh
