// Bvh: how it is made.
#include "umbel/triangle_bvh.hpp"

#include <algorithm>
#include <string>
#include <utility>

#include "base/math.hpp"
#include "base/parallel.hpp"
#include "base/progress.hpp"
#include "bvh/tree/check.hpp"
#include "bvh/tree/config.hpp"
#include "bvh/wide/widen.hpp"
#include "bvh/wide/widen_kary.hpp"
#include "query/leaf_lists.hpp"
#include "query/ray_kernels.hpp"

namespace umbel {
namespace {

void check_config(const BvhConfig& config) {
  if (config.width != 2 && config.width != 4 && config.width != 8)
    throw Error(ErrorCode::kInvalidArgument,
                "width must be 2, 4 or 8, but is " + std::to_string(config.width));
  choose_simd(config.simd);
  bvh::check_cost(config.tree.cost);
}

/// A tree lacks no triangle but those that its build was to drop.
void check_presence(std::span<const uint32_t> primitives, const MeshView& mesh,
                    bvh::InvalidTriangles invalid) {
  std::vector<uint8_t> is_there(mesh.triangles.size(), 0);
  for (const uint32_t primitive : primitives) is_there[primitive] = 1;
  const auto is_dropped = [&](const Triangle& triangle) {
    return invalid == bvh::InvalidTriangles::kDrop &&
           std::any_of(triangle.begin(), triangle.end(), [&](uint32_t vertex) {
             return vertex < mesh.positions.size() && !is_finite(mesh.positions[vertex]);
           });
  };
  for (size_t i = 0; i < is_there.size(); ++i)
    if (!is_there[i] && !is_dropped(mesh.triangles[i]))
      throw Error(ErrorCode::kCorrupt, "primitive " + std::to_string(i) + " is not in the tree");
}

BvhData make_data(const bvh::Bvh2& tree, const MeshView& mesh, const BvhConfig& config,
                  const WidenOptions& options, std::span<const uint32_t> masks, uint32_t threads) {
  BvhData data;
  with_threads(threads, [&] {
    data = widen_tree(tree, mesh, options, masks);
    data.cost = config.tree.cost;
    data.sah_cost = data.built_sah_cost = bvh::sah_cost(tree, config.tree.cost);
  });
  prepare_rays(data, config.simd);
  return data;
}

}  // namespace

Bvh::Bvh() : TriangleQueries(std::make_unique<Data>()) { prepare_rays(data(), Simd::kAuto); }
Bvh::~Bvh() = default;
// What was moved from stays a tree without triangles, so that every query on it has an answer.
Bvh::Bvh(Bvh&& other) : Bvh() { swap(other); }
Bvh& Bvh::operator=(Bvh&& other) noexcept {
  swap(other);
  return *this;
}

Bvh Bvh::build(const MeshView& mesh, const BvhConfig& config, std::span<const uint32_t> masks,
               const BuildOptions& options) {
  check_config(config);
  check_masks(masks, mesh.triangles.size());
  const bvh::Bvh2 tree = bvh::build(mesh, config.tree, options);
  WidenOptions widening{config.width, config.compact};
  widening.is_valid = true;
  widening.may_repeat = config.tree.builder == bvh::Builder::kSpatial;
  Bvh result;
  static_cast<BvhData&>(result.data()) =
      make_data(tree, mesh, config, widening, masks, options.threads);
  return result;
}

Bvh Bvh::widen(const bvh::Bvh2& tree, const MeshView& mesh, const BvhConfig& config,
               std::span<const uint32_t> masks, const BuildOptions& options) {
  check_config(config);
  check_masks(masks, mesh.triangles.size());
  bvh::check_structure(tree, static_cast<uint32_t>(mesh.triangles.size()));
  Progress progress(options);
  progress.report(0, "widening");
  check_presence(tree.primitives, mesh, config.tree.invalid);
  const bvh::Bvh2* source = &tree;
  bvh::Bvh2 shallow;
  if (bvh::statistics(tree).max_depth > bvh::kDeepest) {
    shallow = tree;
    bvh::limit_depth(shallow, bvh::kDeepest);
    source = &shallow;
  }
  Bvh result;
  static_cast<BvhData&>(result.data()) =
      make_data(*source, mesh, config, {config.width, config.compact}, masks, options.threads);
  progress.report(1, "widening");
  return result;
}

Bvh Bvh::widen(const bvh::KaryTree& tree, const MeshView& mesh, const BvhConfig& config,
               std::span<const uint32_t> masks, const BuildOptions& options) {
  check_config(config);
  check_masks(masks, mesh.triangles.size());
  bvh::check(tree, static_cast<uint32_t>(mesh.triangles.size()));
  check_presence(tree.primitives, mesh, config.tree.invalid);
  check_triangles(mesh, tree.primitives);
  Progress progress(options);
  progress.report(0, "widening");
  Bvh result;
  BvhData& data = result.data();
  with_threads(options.threads,
               [&] { data = widen_kary(tree, mesh, {config.width, config.compact}, masks); });
  data.cost = config.tree.cost;
  data.sah_cost = data.built_sah_cost = bvh::sah_cost(tree, config.tree.cost);
  prepare_rays(data, config.simd);
  progress.report(1, "widening");
  return result;
}

BvhStatistics Bvh::statistics() const {
  const Data& d = data();
  return {d.width,           d.node_count(), d.leaf_count, d.nodes.empty() ? 0 : d.max_depth,
          d.reference_count, d.sah_cost,     d.bytes()};
}

}  // namespace umbel
