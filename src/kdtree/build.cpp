// From a mesh or boxes to a kd-tree: checks the input, and runs a builder.
#include <array>
#include <cmath>
#include <numeric>
#include <string>

#include "base/parallel.hpp"
#include "base/printed.hpp"
#include "bvh/tree/config.hpp"
#include "kdtree/builders.hpp"
#include "kdtree/clip.hpp"
#include "query/leaf_lists.hpp"

namespace umbel::kdtree {
namespace {

constexpr std::array<std::string_view, 2> kNames{"exact", "binned"};

/// Nodes are numbered by 30 bits.
constexpr uint64_t kMostReferences = uint64_t{1} << 28;

template <typename Number>
void check_range(const char* name, Number value, Number low, Number high) {
  if (value >= low && value <= high) return;
  throw Error(ErrorCode::kInvalidArgument, std::string(name) + " is " + printed(value) +
                                               ", but must be from " + printed(low) + " to " +
                                               printed(high));
}

void check_config(const Config& c) {
  if (static_cast<size_t>(c.builder) >= kNames.size())
    throw Error(ErrorCode::kInvalidArgument,
                "builder " + std::to_string(static_cast<uint32_t>(c.builder)) + " does not exist");
  if (c.invalid != bvh::InvalidTriangles::kRefuse && c.invalid != bvh::InvalidTriangles::kDrop)
    throw Error(ErrorCode::kInvalidArgument, "invalid must be to refuse or to drop");
  bvh::check_cost(c.cost);
  check_range("empty_bonus", c.empty_bonus, 0.0f, 0.9f);
  check_range("max_depth", c.max_depth, 0u, 64u);
  check_range("bad_refines", c.bad_refines, 0u, 64u);
  check_range("max_references", c.max_references, 1.0f, 64.0f);
  check_range("bins", c.bins, 4u, 256u);
  check_range("target_leaf_size", c.target_leaf_size, 0u, 255u);
}

uint32_t depth_limit(const Config& config, size_t count) {
  if (config.max_depth > 0) return config.max_depth;
  return std::min(64u, static_cast<uint32_t>(8 + 1.3 * std::log2(double(count))));
}

CostRule cost_rule(const Config& config, const Aabb& bounds) {
  double longest = 0;
  for (uint32_t axis = 0; axis < 3; ++axis)
    longest = std::max(longest,
                       double(component(bounds.max, axis)) - double(component(bounds.min, axis)));
  return {config.cost.traversal, config.cost.intersection, 1 - double(config.empty_bonus),
          longest * 1e-9, config.target_leaf_size};
}

/// `boxes` are those of the primitives `numbers`.
Tree build_over(const Primitives& primitives, std::span<const uint32_t> numbers,
                std::span<const Aabb> boxes, const Config& config, Progress& progress) {
  Aabb bounds;
  for (const Aabb& box : boxes) extend(bounds, box);
  const double spare = double(numbers.size()) * (double(config.max_references) - 1);
  const uint64_t room = kMostReferences - numbers.size();
  const Allowance allowance{depth_limit(config, numbers.size()), config.bad_refines,
                            std::min(static_cast<uint64_t>(spare), room)};
  const CostRule rule = cost_rule(config, bounds);
  const Input input{primitives, numbers, boxes, bounds, rule, allowance};
  Branch root;
  (config.builder == Builder::kExact ? build_exact : build_binned)(input, config, progress, root);
  progress.report(0.95, "joining subtrees");
  return join(root, bounds);
}

Tree build_usable(const MeshView& mesh, std::span<const uint32_t> triangles, const Config& config,
                  Progress& progress) {
  std::vector<Aabb> boxes(triangles.size());
  parallel_for(triangles.size(), 4096, [&](size_t i) {
    for (const Vec3& corner : corners_of(mesh, triangles[i])) extend(boxes[i], corner);
  });
  return build_over(Primitives(mesh), triangles, boxes, config, progress);
}

void check_boxes(std::span<const Aabb> boxes) {
  for (size_t i = 0; i < boxes.size(); ++i) {
    const Aabb& box = boxes[i];
    if (is_finite(box.min) && is_finite(box.max) && !is_empty(box)) continue;
    throw Error(ErrorCode::kInvalidMesh,
                "box " + std::to_string(i) + " is empty, or has a NaN or infinite corner");
  }
}

void check_count(size_t count, const char* what) {
  if (count < kMostReferences) return;
  throw Error(ErrorCode::kUnsupported, std::to_string(count) + " " + what + " are more than the " +
                                           std::to_string(kMostReferences) +
                                           " that a kd-tree can hold");
}

}  // namespace

std::string_view name(Builder builder) { return kNames.at(static_cast<size_t>(builder)); }

Builder builder_by_name(std::string_view name) {
  for (size_t i = 0; i < kNames.size(); ++i)
    if (kNames[i] == name) return static_cast<Builder>(i);
  throw Error(ErrorCode::kInvalidArgument, "there is no kd-tree builder \"" + std::string(name) +
                                               "\"; the builders are exact, binned");
}

Tree build(const MeshView& mesh, const Config& config, const BuildOptions& options) {
  check_config(config);
  check_count(mesh.triangles.size(), "triangles");
  MeshView geometry;
  geometry.positions = mesh.positions;
  geometry.triangles = mesh.triangles;
  Progress progress(options);
  progress.report(0, "checking triangles");
  Tree tree;
  with_threads(options.threads, [&] {
    const std::vector<uint32_t> triangles =
        usable_triangles(geometry, config.invalid == bvh::InvalidTriangles::kDrop);
    progress.report(0.02, "checking triangles");
    if (!triangles.empty()) tree = build_usable(geometry, triangles, config, progress);
  });
  progress.report(1, "joining subtrees");
  return tree;
}

Tree build(std::span<const Aabb> boxes, const Config& config, const BuildOptions& options) {
  check_config(config);
  check_count(boxes.size(), "boxes");
  Progress progress(options);
  progress.report(0, "checking boxes");
  Tree tree;
  with_threads(options.threads, [&] {
    check_boxes(boxes);
    if (boxes.empty()) return;
    std::vector<uint32_t> numbers(boxes.size());
    std::iota(numbers.begin(), numbers.end(), 0u);
    // -0 and 0 are one plane.
    std::vector<Aabb> clean(boxes.begin(), boxes.end());
    for (Aabb& box : clean) box = without_negative_zero(box);
    tree = build_over(Primitives(std::span<const Aabb>(clean)), numbers, clean, config, progress);
  });
  progress.report(1, "joining subtrees");
  return tree;
}

}  // namespace umbel::kdtree
