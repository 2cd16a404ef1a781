// KdTree: how it is made.
#include <algorithm>
#include <array>
#include <string>
#include <utility>

#include "base/parallel.hpp"
#include "bvh/tree/config.hpp"
#include "kdtree/cell_nodes.hpp"
#include "kdtree/ray_kernels.hpp"
#include "query/leaf_store.hpp"
#include "query/ray_kernels.hpp"
#include "query/shape_kernels.hpp"

namespace umbel {
void prepare_rays(KdTreeData& data) {
  // Leaves are too small for AVX-512 to bring anything.
  const bool is_plain = choose_simd(data.simd) == Simd::kPortable;
  data.rays = is_plain ? portable_kd_kernels(data.traversal) : avx2_kd_kernels(data.traversal);
  if (data.nodes.empty()) data.rays = &kNoRays;
  data.shapes = &shape_kernels_of<KdNodes>;
  if (data.traversal == kdtree::Traversal::kRopes) make_ropes(data);
  prepare_scale(data);
}

namespace kdtree {
namespace {

constexpr std::array<std::string_view, 3> kTraversals{"stack", "ropes", "short-stack"};

void check_traversal(Traversal traversal) {
  if (static_cast<size_t>(traversal) >= kTraversals.size())
    throw Error(
        ErrorCode::kInvalidArgument,
        "traversal " + std::to_string(static_cast<uint32_t>(traversal)) + " does not exist");
}

KdTreeData make_data(const Tree& tree, const MeshView& mesh, const KdTreeConfig& config,
                     std::span<const uint32_t> masks) {
  KdTreeData data;
  data.compact = config.compact;
  data.traversal = config.traversal;
  data.simd = config.simd;
  data.cost = config.tree.cost;
  data.bounds = tree.bounds;
  data.statistics = kdtree::statistics(tree, config.tree.cost);
  data.nodes.assign(tree.nodes.begin(), tree.nodes.end());
  std::vector<Range> lists;
  for (const Node& node : tree.nodes)
    if (node.is_leaf()) lists.push_back(node.list());
  fill_store(lists, tree.references, mesh, masks, data);
  prepare_rays(data);
  return data;
}

}  // namespace

std::string_view name(Traversal traversal) {
  check_traversal(traversal);
  return kTraversals[static_cast<size_t>(traversal)];
}

Traversal traversal_by_name(std::string_view name) {
  for (size_t i = 0; i < kTraversals.size(); ++i)
    if (kTraversals[i] == name) return static_cast<Traversal>(i);
  throw Error(ErrorCode::kInvalidArgument, "there is no traversal \"" + std::string(name) +
                                               "\"; there are stack, ropes, short-stack");
}

KdTree::KdTree() : TriangleQueries(std::make_unique<Data>()) { prepare_rays(data()); }
KdTree::~KdTree() = default;
// What was moved from stays a tree without triangles, so that every query on it has an answer.
KdTree::KdTree(KdTree&& other) : KdTree() { swap(other); }
KdTree& KdTree::operator=(KdTree&& other) noexcept {
  swap(other);
  return *this;
}

KdTree KdTree::build(const MeshView& mesh, const KdTreeConfig& config,
                     std::span<const uint32_t> masks, const BuildOptions& options) {
  check_traversal(config.traversal);
  choose_simd(config.simd);
  check_masks(masks, mesh.triangles.size());
  const Tree tree = kdtree::build(mesh, config.tree, options);
  KdTree result;
  with_threads(options.threads, [&] {
    static_cast<KdTreeData&>(result.data()) = make_data(tree, mesh, config, masks);
  });
  return result;
}

KdTree KdTree::of(const Tree& tree, const MeshView& mesh, const KdTreeConfig& config,
                  std::span<const uint32_t> masks, const BuildOptions& options) {
  check_traversal(config.traversal);
  bvh::check_cost(config.tree.cost);
  check_masks(masks, mesh.triangles.size());
  MeshView geometry;
  geometry.positions = mesh.positions;
  geometry.triangles = mesh.triangles;
  validate(geometry, options);
  check(tree, static_cast<uint32_t>(mesh.triangles.size()));
  if (tree.references.size() > kMaxReferences)
    throw Error(ErrorCode::kUnsupported, "a tree of " + std::to_string(tree.references.size()) +
                                             " references is larger than the " +
                                             std::to_string(kMaxReferences) + " supported");
  KdTree result;
  with_threads(options.threads, [&] {
    static_cast<KdTreeData&>(result.data()) = make_data(tree, mesh, config, masks);
  });
  return result;
}

void KdTree::set_traversal(Traversal traversal) {
  check_traversal(traversal);
  // Before anything changes, as there may be no memory.
  if (traversal == Traversal::kRopes) make_ropes(data());
  data().traversal = traversal;
  prepare_rays(data());
}

Traversal KdTree::traversal() const { return data().traversal; }

Statistics KdTree::statistics() const {
  const Data& d = data();
  Statistics s = d.statistics;
  s.bytes = d.nodes.size() * sizeof(Node) + d.leaf_bytes() +
            d.rope_leaves.size() * sizeof(RopeLeaf) + d.rope_leaf_of.size() * sizeof(uint32_t);
  return s;
}

}  // namespace kdtree
}  // namespace umbel
