// KdTree: how it is made, and its queries, which go to the kernels of this machine.
#include <algorithm>
#include <array>
#include <string>
#include <utility>

#include "base/parallel.hpp"
#include "bvh/leaf_store.hpp"
#include "bvh/ray_kernels.hpp"
#include "kdtree/ray_kernels.hpp"

namespace umbel {
namespace {

/// For trees without nodes, so that no kernel has to ask.
Hit miss(const KdTreeData& /*tree*/, const Ray& /*ray*/, const RayOptions& /*options*/) {
  return {};
}
bool nothing_between(const KdTreeData& /*tree*/, const Ray& /*ray*/,
                     const RayOptions& /*options*/) {
  return false;
}
size_t no_hits(const KdTreeData& /*tree*/, const Ray& /*ray*/, std::span<Hit> /*hits*/,
               const RayOptions& /*options*/) {
  return 0;
}
constexpr KdRayKernels kEmptyTree{miss, nothing_between, no_hits};

}  // namespace

void prepare_rays(KdTreeData& data) {
  // Leaves are too small for AVX-512 to bring anything.
  const bool is_plain = choose_simd(data.simd) == Simd::kPortable;
  data.kernels = is_plain ? portable_kd_kernels(data.traversal) : avx2_kd_kernels(data.traversal);
  if (data.nodes.empty()) data.kernels = &kEmptyTree;
  if (data.traversal == kdtree::Traversal::kRopes) make_ropes(data);
  prepare_scale(data);
}

namespace kdtree {
namespace {

constexpr std::array<std::string_view, 3> kTraversals{"stack", "ropes", "short-stack"};

/// Rays that one task traces: enough to hide what starting it costs.
constexpr size_t kRaysAtOnce = 256;

void check_masks(std::span<const uint32_t> masks, size_t triangles) {
  if (!masks.empty() && masks.size() != triangles)
    throw Error(ErrorCode::kInvalidArgument, "masks must be empty or one a triangle: there are " +
                                                 std::to_string(masks.size()) + " masks and " +
                                                 std::to_string(triangles) + " triangles");
}

void check_same_length(size_t rays, size_t results, const char* what) {
  if (rays != results)
    throw Error(ErrorCode::kInvalidArgument,
                std::string(what) + " must be as many as the rays: there are " +
                    std::to_string(results) + " and " + std::to_string(rays) + " rays");
}

void check_traversal(Traversal traversal) {
  if (static_cast<size_t>(traversal) >= kTraversals.size())
    throw Error(
        ErrorCode::kInvalidArgument,
        "traversal " + std::to_string(static_cast<uint32_t>(traversal)) + " does not exist");
}

/// Writes every list once, in leaves of up to eight triangles.
void fill_leaves(const Tree& tree, const MeshView& mesh, std::span<const uint32_t> masks,
                 KdTreeData& data) {
  std::vector<uint32_t> links;
  uint32_t filled = 0;
  for (const Node& node : tree.nodes) {
    if (!node.is_leaf() || node.first < filled) continue;  // else shared
    visit_links(node, [&](uint32_t link) { links.push_back(link); });
    filled += node.count();
  }
  std::vector<uint32_t> places;
  if (data.compact) places = collect_vertices(mesh, tree.references, data.vertices);
  data.leaves.resize(size_t{data.reference_count} * data.reference_words() + kLeafPadding);
  parallel_for(links.size(), 1024,
               [&](size_t i) { fill_leaf(mesh, masks, places, tree.references, links[i], data); });
}

KdTreeData make_data(const Tree& tree, const MeshView& mesh, const KdTreeConfig& config,
                     std::span<const uint32_t> masks) {
  KdTreeData data;
  data.compact = config.compact;
  data.masked = std::any_of(masks.begin(), masks.end(), [](uint32_t m) { return m != ~0u; });
  data.triangle_count = static_cast<uint32_t>(mesh.triangles.size());
  data.traversal = config.traversal;
  data.simd = config.simd;
  data.cost = config.tree.cost;
  data.bounds = tree.bounds;
  data.statistics = kdtree::statistics(tree, config.tree.cost);
  if (!tree.nodes.empty()) {
    data.reference_count = static_cast<uint32_t>(tree.references.size());
    data.nodes.assign(tree.nodes.begin(), tree.nodes.end());
    fill_leaves(tree, mesh, masks, data);
  }
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

KdTree::KdTree() : data_(std::make_unique<Data>()) { prepare_rays(*data_); }
KdTree::~KdTree() = default;
// What was moved from stays a tree without triangles, so that every query on it has an answer.
KdTree::KdTree(KdTree&& other) noexcept : KdTree() { data_.swap(other.data_); }
KdTree& KdTree::operator=(KdTree&& other) noexcept {
  data_.swap(other.data_);
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
    static_cast<KdTreeData&>(*result.data_) = make_data(tree, mesh, config, masks);
  });
  return result;
}

KdTree KdTree::of(const Tree& tree, const MeshView& mesh, const KdTreeConfig& config,
                  std::span<const uint32_t> masks, const BuildOptions& options) {
  check_traversal(config.traversal);
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
    static_cast<KdTreeData&>(*result.data_) = make_data(tree, mesh, config, masks);
  });
  return result;
}

Hit KdTree::intersect(const Ray& ray, const RayOptions& options) const {
  return data_->kernels->intersect(*data_, ray, options);
}

bool KdTree::occluded(const Ray& ray, const RayOptions& options) const {
  return data_->kernels->occluded(*data_, ray, options);
}

size_t KdTree::all_hits(const Ray& ray, std::span<Hit> hits, const RayOptions& options) const {
  return data_->kernels->all_hits(*data_, ray, hits, options);
}

void KdTree::intersect(std::span<const Ray> rays, std::span<Hit> hits, const RayOptions& options,
                       uint32_t threads) const {
  check_same_length(rays.size(), hits.size(), "hits");
  with_threads(threads, [&] {
    parallel_chunks(rays.size(), kRaysAtOnce, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i)
        hits[i] = data_->kernels->intersect(*data_, rays[i], options);
    });
  });
}

void KdTree::occluded(std::span<const Ray> rays, std::span<uint8_t> results,
                      const RayOptions& options, uint32_t threads) const {
  check_same_length(rays.size(), results.size(), "results");
  with_threads(threads, [&] {
    parallel_chunks(rays.size(), kRaysAtOnce, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i)
        results[i] = data_->kernels->occluded(*data_, rays[i], options) ? 1 : 0;
    });
  });
}

void KdTree::set_traversal(Traversal traversal) {
  check_traversal(traversal);
  data_->traversal = traversal;
  prepare_rays(*data_);
}

Traversal KdTree::traversal() const { return data_->traversal; }

Statistics KdTree::statistics() const {
  Statistics s = data_->statistics;
  s.bytes = data_->nodes.size() * sizeof(Node) + data_->leaf_bytes() +
            data_->rope_leaves.size() * sizeof(RopeLeaf) +
            data_->rope_leaf_of.size() * sizeof(uint32_t);
  return s;
}

Aabb KdTree::bounds() const { return data_->bounds; }

uint32_t KdTree::triangle_count() const { return data_->triangle_count; }

}  // namespace kdtree
}  // namespace umbel
