// From boxes or triangles to a tree: checks the input, brings it to a scale at which areas neither
// overflow nor vanish, runs a builder, and then the passes that the configuration asks for.
#include <array>
#include <atomic>
#include <bit>
#include <cmath>
#include <string>

#include "base/cpu_buffer.hpp"
#include "base/first_where.hpp"
#include "base/math.hpp"
#include "base/parallel.hpp"
#include "base/printed.hpp"
#include "base/progress.hpp"
#include "base/simd/box4.hpp"
#include "bvh/build/builders.hpp"
#include "bvh/optimize/reinsertion.hpp"
#include "bvh/tree/config.hpp"
#include "bvh/tree/scale.hpp"
#include "mesh/streams.hpp"

namespace umbel::bvh {
namespace {

using BoxBuilder = Bvh2 (*)(Boxes, const Config&, BuildProgress&);
using TriangleBuilder = Bvh2 (*)(const MeshView&, Boxes, const Config&, BuildProgress&);

struct Entry {
  Builder builder;
  std::string_view name;
  BoxBuilder over_boxes = nullptr;  ///< neither: this build does not have it
  TriangleBuilder over_triangles = nullptr;
  bool is_final = false;  ///< its trees are collapsed, within max_depth and in order
};

constexpr std::array kEntries{
    Entry{Builder::kSweep, "sweep", build_sweep},
    Entry{Builder::kBinned, "binned", build_binned, nullptr, true},
    Entry{Builder::kSpatial, "sbvh", nullptr, build_spatial, true},
    Entry{Builder::kLbvh, "lbvh", build_lbvh, nullptr, true},
    Entry{Builder::kHlbvh, "hlbvh", build_hlbvh},
    Entry{Builder::kKmeans, "kmeans", build_kmeans},
    Entry{Builder::kAgglomerative, "agglomerative", build_agglomerative},
    Entry{Builder::kAac, "aac", build_aac},
    Entry{Builder::kPloc, "ploc", build_ploc},
    Entry{Builder::kAtrbvh, "atrbvh", build_atrbvh},
    Entry{Builder::kInsertion, "insertion", build_insertion},
};

constexpr size_t kPrimitivesAtOnce = size_t{1} << 14;

const Entry& entry_of(Builder builder) { return kEntries[static_cast<size_t>(builder)]; }

bool is_built(const Entry& entry) { return entry.over_boxes || entry.over_triangles; }

std::string listed_names() {
  std::string names;
  for (const Entry& entry : kEntries)
    names += (names.empty() ? "" : ", ") + std::string(entry.name);
  return names;
}

void check_supported(const Config& config) {
  const Entry& entry = entry_of(config.builder);
  if (!is_built(entry))
    throw Error(ErrorCode::kUnsupported,
                "this build has no builder \"" + std::string(entry.name) + "\"");
}

void check_count(size_t primitives) {
  if (primitives > kMaxPrimitives)
    throw Error(ErrorCode::kInvalidArgument,
                std::to_string(primitives) + " primitives are more than the " +
                    std::to_string(kMaxPrimitives) + " that a tree can hold");
}

/// False for boxes that are empty or have a NaN or an infinity.
bool is_valid(const Aabb& b) { return is_finite(b.min) && is_finite(b.max) && !is_empty(b); }

void check_boxes(Boxes boxes) {
  const size_t bad =
      first_where(boxes.size(), kPrimitivesAtOnce, [&](size_t i) { return !is_valid(boxes[i]); });
  if (bad == boxes.size()) return;
  const Aabb& b = boxes[bad];
  throw Error(ErrorCode::kInvalidMesh,
              "box " + std::to_string(bad) + " from " + printed_vector(b.min) + " to " +
                  printed_vector(b.max) +
                  (is_finite(b.min) && is_finite(b.max) ? " is empty" : " is not finite"));
}

Aabb box_of_all(Boxes boxes) {
  std::vector<Aabb> parts((boxes.size() + kPrimitivesAtOnce - 1) / kPrimitivesAtOnce);
  parallel_chunks(boxes.size(), kPrimitivesAtOnce, [&](size_t begin, size_t end) {
    Aabb part;
    for (size_t i = begin; i < end; ++i) extend(part, boxes[i]);
    parts[begin / kPrimitivesAtOnce] = part;
  });
  Aabb all;
  for (const Aabb& part : parts) extend(all, part);
  return all;
}

Bvh2 run_builder(const MeshView* mesh, Boxes boxes, const Config& config, BuildProgress& progress) {
  const Entry& entry = entry_of(config.builder);
  if (entry.over_boxes) return entry.over_boxes(boxes, config, progress);
  return entry.over_triangles(*mesh, boxes, config, progress);
}

Bvh2 run_scaled(const MeshView* mesh, Boxes boxes, float scale, const Config& config,
                BuildProgress& progress) {
  std::vector<Aabb> scaled_boxes(boxes.size());
  parallel_for(boxes.size(), kPrimitivesAtOnce,
               [&](size_t i) { scaled_boxes[i] = scaled(boxes[i], scale); });
  if (!mesh) return run_builder(nullptr, scaled_boxes, config, progress);
  std::vector<Vec3> positions(mesh->positions.size());
  parallel_for(positions.size(), kPrimitivesAtOnce,
               [&](size_t i) { positions[i] = mesh->positions[i] * scale; });
  MeshView scaled_mesh = *mesh;
  scaled_mesh.positions = positions;
  return run_builder(&scaled_mesh, scaled_boxes, config, progress);
}

/// A part's box at the input's own scale. What underflowed may have been cut off, so the box grows
/// by that, but not beyond the triangles of the part.
Aabb unscaled(const Aabb& part, const Aabb& whole, float scale) {
  const float error = std::max(0x1p-146f / scale, 0x1p-149f);
  const Aabb box = scaled(part, 1.0f / scale);
  return {max(box.min - Vec3{error, error, error}, whole.min),
          min(box.max + Vec3{error, error, error}, whole.max)};
}

/// Boxes at the input's own scale.
void unscale(Bvh2& tree, Boxes boxes, float scale, bool parts) {
  for (size_t i = tree.nodes.size(); i-- > 0;) {
    Node& node = tree.nodes[i];
    Aabb box;
    if (!node.is_leaf()) {
      box = tree.nodes[node.first].box();
      extend(box, tree.nodes[node.first + 1].box());
    } else {
      for (uint32_t k = 0; k < node.count; ++k) extend(box, boxes[tree.primitives[node.first + k]]);
      if (parts) box = unscaled(node.box(), box, scale);
    }
    node.min = box.min;
    node.max = box.max;
  }
}

/// Without area, builders cannot know which leaves are cheap.
bool has_area(const Node& node) {
  const Vec3 e = node.max - node.min;
  return (e.x > 0) + (e.y > 0) + (e.z > 0) >= 2;
}

Bvh2 build_checked(const MeshView* mesh, Boxes boxes, const Config& config,
                   BuildProgress& progress) {
  const bool parts = config.builder == Builder::kSpatial;
  const float scale = moderate_scale(box_of_all(boxes));
  Bvh2 tree = scale == 1.0f ? run_builder(mesh, boxes, config, progress)
                            : run_scaled(mesh, boxes, scale, config, progress);
  if (config.reinsertion_rounds > 0) {
    progress.report(0.8, "reinserting");
    const bool is_good = config.builder == Builder::kSpatial;
    reinsert(tree, config.reinsertion_rounds, is_good ? kReinsertedOfGood : kReinserted, {});
  }
  if (!entry_of(config.builder).is_final || config.reinsertion_rounds > 0 ||
      !has_area(tree.nodes[0])) {
    progress.report(0.9, "collapsing leaves");
    limit_depth(tree, config.max_depth);
    collapse_leaves(tree, config.cost, config.max_leaf_size);
  }
  if (scale != 1.0f) unscale(tree, boxes, scale, parts);
  return tree;
}

bool has_finite_corners(const MeshView& mesh, size_t triangle) {
  for (const uint32_t vertex : mesh.triangles[triangle])
    if (!is_finite(mesh.positions[vertex])) return false;
  return true;
}

[[noreturn]] void refuse_triangle(const MeshView& mesh, size_t triangle) {
  uint32_t corner = 0;
  while (is_finite(mesh.positions[mesh.triangles[triangle][corner]])) ++corner;
  const uint32_t vertex = mesh.triangles[triangle][corner];
  throw Error(ErrorCode::kInvalidMesh,
              "triangle " + std::to_string(triangle) + ", corner " + std::to_string(corner) +
                  ": the position of vertex " + std::to_string(vertex) + " is " +
                  printed_vector(mesh.positions[vertex]) + ", which is not finite");
}

/// A position in the first three lanes. What follows it in memory may be read with it.
Float4 corner_of(const MeshView& mesh, uint32_t vertex) {
  const Vec3& p = mesh.positions[vertex];
  return vertex + size_t{1} < mesh.positions.size() ? load4(&p.x) : Float4{p.x, p.y, p.z, 0};
}

/// False, and a box without meaning, where a corner is not finite.
bool find_box(const MeshView& mesh, size_t triangle, Aabb& box) {
  const Triangle& corners = mesh.triangles[triangle];
  const Float4 a = corner_of(mesh, corners[0]), b = corner_of(mesh, corners[1]),
               c = corner_of(mesh, corners[2]);
  const Float4 low = min4(min4(a, b), c), negated_high = min4(min4(-a, -b), -c);
  box = {{low[0], low[1], low[2]}, {-negated_high[0], -negated_high[1], -negated_high[2]}};
  // An infinity times zero is no number, and neither is anything added to one.
  const Float4 zero = a * 0.0f + b * 0.0f + c * 0.0f;
  return zero[0] + zero[1] + zero[2] == 0;
}

/// Calls build(mesh, boxes) over the triangles that can be, and numbers them as the mesh does.
template <typename Build>
auto build_triangles(const MeshView& mesh, const Config& config, const Build& build) {
  check_indices(mesh);
  const size_t count = mesh.triangles.size();
  const CpuBuffer<Aabb> boxes(count);
  const size_t bad =
      first_where(count, kPrimitivesAtOnce, [&](size_t i) { return !find_box(mesh, i, boxes[i]); });
  if (bad == count) return build(mesh, Boxes(boxes.data(), count));
  if (config.invalid == InvalidTriangles::kRefuse) refuse_triangle(mesh, bad);
  std::vector<uint32_t> kept;
  for (size_t i = 0; i < count; ++i)
    if (has_finite_corners(mesh, i)) kept.push_back(static_cast<uint32_t>(i));
  std::vector<Triangle> triangles(kept.size());
  for (size_t i = 0; i < kept.size(); ++i) {
    find_box(mesh, kept[i], boxes[i]);
    triangles[i] = mesh.triangles[kept[i]];
  }
  MeshView view;
  view.positions = mesh.positions;
  view.triangles = triangles;
  auto tree = build(view, Boxes(boxes.data(), kept.size()));
  for (uint32_t& primitive : tree.primitives) primitive = kept[primitive];
  return tree;
}

}  // namespace

std::string_view name(Builder builder) {
  if (static_cast<size_t>(builder) >= kEntries.size())
    throw Error(ErrorCode::kInvalidArgument,
                "builder " + std::to_string(static_cast<uint32_t>(builder)) + " does not exist");
  return entry_of(builder).name;
}

Builder builder_by_name(std::string_view name) {
  for (const Entry& entry : kEntries)
    if (entry.name == name) return entry.builder;
  throw Error(ErrorCode::kInvalidArgument, "there is no builder \"" + std::string(name) +
                                               "\"; the builders are " + listed_names());
}

std::span<const Builder> builders() {
  static const std::vector<Builder> built = [] {
    std::vector<Builder> all;
    for (const Entry& entry : kEntries)
      if (is_built(entry)) all.push_back(entry.builder);
    return all;
  }();
  return built;
}

Config preset(std::string_view name) {
  Config config;
  if (name == "quality") return config;
  if (name == "fast") {
    if (is_built(entry_of(Builder::kLbvh))) config.builder = Builder::kLbvh;
    return config;
  }
  if (name == "best") {
    if (is_built(entry_of(Builder::kSpatial))) config.builder = Builder::kSpatial;
    config.reinsertion_rounds = 2;
    return config;
  }
  throw Error(ErrorCode::kInvalidArgument, "there is no preset \"" + std::string(name) +
                                               "\"; the presets are fast, quality, best");
}

Bvh2 build(std::span<const Aabb> boxes, const Config& config, const BuildOptions& options,
           const StageObserver& observer) {
  check_count(boxes.size());
  check_config(config, boxes.size());
  check_supported(config);
  if (!entry_of(config.builder).over_boxes)
    throw Error(ErrorCode::kInvalidArgument,
                "builder is \"" + std::string(name(config.builder)) +
                    "\", which splits triangles and so cannot build over boxes");
  BuildProgress progress(options, observer);
  progress.report(0, "building");
  Bvh2 tree;
  with_threads(options.threads, [&] {
    check_boxes(boxes);
    if (!boxes.empty()) tree = build_checked(nullptr, boxes, config, progress);
  });
  progress.report(1, "building");
  return tree;
}

Bvh2 build(const MeshView& mesh, const Config& config, const BuildOptions& options,
           const StageObserver& observer) {
  check_count(mesh.triangles.size());
  check_config(config, mesh.triangles.size());
  check_supported(config);
  BuildProgress progress(options, observer);
  progress.report(0, "building");
  Bvh2 tree;
  with_threads(options.threads, [&] {
    if (mesh.triangles.empty()) return;
    tree = build_triangles(mesh, config, [&](const MeshView& usable, Boxes boxes) {
      return boxes.empty() ? Bvh2{} : build_checked(&usable, boxes, config, progress);
    });
  });
  progress.report(1, "building");
  return tree;
}

KaryTree build_kmeans_kary(const MeshView& mesh, const Config& config,
                           const BuildOptions& options) {
  check_count(mesh.triangles.size());
  check_config(config, mesh.triangles.size());
  KaryTree tree;
  with_threads(options.threads, [&] {
    tree = build_triangles(mesh, config, [&](const MeshView& /*usable*/, Boxes boxes) {
      return build_kmeans_kary(boxes, config, options);
    });
  });
  return tree;
}

}  // namespace umbel::bvh
