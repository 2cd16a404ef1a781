// Saving and loading of a KdTree: docs/kdtree.md has every byte. Loading checks the checksums first
// and then, because a checksum proves nothing about who wrote it, every link: what it returns is a
// tree, and no query on it can leave its arrays or go round in circles.
#include <bit>
#include <cmath>
#include <string>

#include "base/container.hpp"
#include "kdtree/tree_data.hpp"

namespace umbel {
namespace {

using kdtree::Node;

constexpr ContainerKind kUmkd{".umkd", {'\x89', 'U', 'M', 'K', 'D', '\r', '\n', '\x1a'}, 1, 0};
constexpr uint32_t kCompactKdTree = 1, kMaskedKdTree = 2;

ContainerFields encode(const KdTreeData& data) {
  ContainerFields fields{};
  ByteWriter out(fields);
  out.u32(data.triangle_count), out.u32(data.reference_count);
  out.u32((data.compact ? kCompactKdTree : 0) | (data.masked ? kMaskedKdTree : 0));
  out.u32(0);
  out.f32(data.cost.traversal), out.f32(data.cost.intersection);
  out.vec3(data.bounds.min), out.vec3(data.bounds.max);
  return fields;
}

/// All but the arrays.
KdTreeData decode_kdtree(const ContainerFields& fields) {
  ByteReader in(fields);
  KdTreeData data;
  data.triangle_count = in.u32(), data.reference_count = in.u32();
  const uint32_t flags = in.u32();
  if (flags > (kCompactKdTree | kMaskedKdTree)) corrupt("the header has unknown flags");
  data.compact = (flags & kCompactKdTree) != 0, data.masked = (flags & kMaskedKdTree) != 0;
  const uint32_t reserved = in.u32();
  data.cost.traversal = in.f32(), data.cost.intersection = in.f32();
  data.bounds.min = in.vec3(), data.bounds.max = in.vec3();
  bool is_zero = reserved == 0;
  for (int i = 0; i < 5; ++i) is_zero &= in.u64() == 0;
  if (!is_zero) corrupt("the header's reserved bytes are not zero");
  return data;
}

/// What the header says of the arrays must agree with itself before anything is allocated.
void check_header(const KdTreeData& data, const ContainerFile& file) {
  constexpr uint64_t kMostNodes = uint64_t{1} << 30;
  if (data.reference_count > kMaxReferences) corrupt("it has too many references");
  if (!(data.cost.traversal > 0) || !(data.cost.intersection > 0) ||
      !std::isfinite(data.cost.traversal) || !std::isfinite(data.cost.intersection))
    corrupt("its costs are not positive numbers");
  const uint64_t leaf_words =
      data.reference_count == 0
          ? 0
          : uint64_t{data.reference_count} * data.reference_words() + kLeafPadding;
  if (file.bytes(0) % sizeof(Node) != 0 || file.bytes(0) / sizeof(Node) > kMostNodes ||
      file.bytes(1) != 4 * leaf_words || file.bytes(2) % sizeof(Vec3) != 0 ||
      (!data.compact && file.bytes(2) != 0) || (file.bytes(0) == 0) != (data.reference_count == 0))
    corrupt("its arrays do not have the sizes that its header asks for");
}

bool is_within(const Vec3& p, const Aabb& box) {
  return p.x >= box.min.x && p.x <= box.max.x && p.y >= box.min.y && p.y <= box.max.y &&
         p.z >= box.min.z && p.z <= box.max.z;
}

/// Takes a leaf's triangles into the references, and checks their corners.
void read_leaf(const KdTreeData& data, uint32_t link, std::span<uint32_t> references) {
  const uint32_t first = LeafStore::first_reference(link), n = LeafStore::leaf_size(link);
  if (data.compact) {
    const uint32_t* const words = data.leaves.data() + size_t{first} * data.reference_words();
    for (uint32_t i = 0; i < 3 * n; ++i)
      if (words[i] >= data.vertices.size()) corrupt("a triangle has a corner that is not there");
  }
  for (uint32_t i = 0; i < n; ++i) {
    const LeafTriangle triangle = data.triangle(link, i);
    for (const Vec3& corner : {triangle.p0, triangle.p1, triangle.p2})
      if (!is_within(corner, data.bounds)) corrupt("a triangle reaches out of the bounds");
    references[first + i] = triangle.primitive;
  }
}

/// The bare tree. Lists that overlap, or are not there, are left for its check to find.
kdtree::Tree tree_of(const KdTreeData& data) {
  kdtree::Tree tree;
  tree.bounds = data.bounds;
  tree.nodes.assign(data.nodes.begin(), data.nodes.end());
  tree.references.assign(data.reference_count, kNone);
  uint64_t end = 0;
  for (const Node& node : tree.nodes) {
    if (!node.is_leaf() || node.first != end) continue;
    end += node.count();
    if (end > data.reference_count) break;
    visit_links(node.list(), [&](uint32_t link) { read_leaf(data, link, tree.references); });
  }
  return tree;
}

KdTreeData read_umkd(const std::string& path) {
  const ContainerFile file(path, kUmkd);
  KdTreeData data = decode_kdtree(file.fields());
  check_header(data, file);
  data.nodes.resize(file.bytes(0) / sizeof(Node));
  data.leaves.resize(file.bytes(1) / 4);
  data.vertices.resize(file.bytes(2) / sizeof(Vec3));
  file.read(container_arrays(data.nodes, data.leaves, data.vertices));
  for (const Vec3& vertex : data.vertices)
    if (!is_within(vertex, data.bounds)) corrupt("a vertex lies out of the bounds");
  const kdtree::Tree tree = tree_of(data);
  kdtree::check(tree, data.triangle_count);
  data.statistics = kdtree::statistics(tree, data.cost);
  return data;
}

}  // namespace

namespace kdtree {

void KdTree::save(const std::string& path) const {
  const Data& d = data();
  write_container(path, kUmkd, encode(d), container_bytes(d.nodes, d.leaves, d.vertices));
}

KdTree KdTree::load(const std::string& path, Traversal traversal, Simd simd) {
  (void)name(traversal);  // throws where there is none
  KdTree result;
  KdTreeData& data = result.data();
  data = reading(path, [&] { return read_umkd(path); });
  data.traversal = traversal;
  data.simd = simd;
  prepare_rays(data);
  return result;
}

}  // namespace kdtree
}  // namespace umbel
