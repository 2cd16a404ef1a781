// Saving and loading of a Bvh: a header, and the arrays as they are in memory, except links
// to nodes, aligned so that a file can be mapped. docs/bvh.md has every byte. Loading checks the
// checksums first and then, because a checksum proves nothing about who wrote it, every link: what
// it returns is a tree, and no query on it can leave its arrays or go round in circles.
#include <bit>
#include <cmath>
#include <string>

#include "base/container.hpp"
#include "bvh/wide/wide_nodes.hpp"

namespace umbel {
namespace {

constexpr ContainerKind kUmbvh{".umbvh", {'\x89', 'U', 'B', 'V', 'H', '\r', '\n', '\x1a'}, 1, 1};
constexpr uint32_t kCompactBvh = 1, kMaskedBvh = 2, kRepeats = 4, kQuantised = 8;

ContainerFields encode(const BvhData& data) {
  ContainerFields fields{};
  ByteWriter out(fields);
  out.u32(data.width), out.u32(data.max_depth);
  out.u32(data.triangle_count), out.u32(data.leaf_count), out.u32(data.reference_count);
  out.u32((data.compact ? kCompactBvh : 0) | (data.masked ? kMaskedBvh : 0) |
          (data.repeats ? kRepeats : 0) | (data.quantised ? kQuantised : 0));
  out.f32(data.cost.traversal), out.f32(data.cost.intersection);
  out.u64(std::bit_cast<uint64_t>(data.sah_cost));
  out.u64(std::bit_cast<uint64_t>(data.built_sah_cost));
  out.vec3(data.bounds.min), out.vec3(data.bounds.max);
  return fields;
}

/// All but the arrays.
BvhData decode_bvh(const ContainerFields& fields) {
  ByteReader in(fields);
  BvhData data;
  data.width = in.u32(), data.max_depth = in.u32();
  data.triangle_count = in.u32(), data.leaf_count = in.u32(), data.reference_count = in.u32();
  const uint32_t flags = in.u32();
  if (flags > (kCompactBvh | kMaskedBvh | kRepeats | kQuantised))
    corrupt("the header has unknown flags");
  data.compact = (flags & kCompactBvh) != 0, data.masked = (flags & kMaskedBvh) != 0;
  data.repeats = (flags & kRepeats) != 0, data.quantised = (flags & kQuantised) != 0;
  data.cost.traversal = in.f32(), data.cost.intersection = in.f32();
  data.sah_cost = std::bit_cast<double>(in.u64());
  data.built_sah_cost = std::bit_cast<double>(in.u64());
  data.bounds.min = in.vec3(), data.bounds.max = in.vec3();
  if (in.u64() != 0 || in.u64() != 0) corrupt("the header's reserved bytes are not zero");
  return data;
}

/// What the header says of the arrays must agree with itself before anything is allocated.
void check_header(const BvhData& data, const ContainerFile& file) {
  if (data.width != 2 && data.width != 4 && data.width != 8)
    corrupt("its width is " + std::to_string(data.width));
  if (data.max_depth > kMaxTraversalDepth)
    corrupt("it is " + std::to_string(data.max_depth) + " deep");
  if (data.reference_count > kMaxReferences) corrupt("it has too many references");
  if (!(data.cost.traversal > 0) || !(data.cost.intersection > 0) ||
      !std::isfinite(data.cost.traversal) || !std::isfinite(data.cost.intersection) ||
      !(data.sah_cost >= 0) || !(data.built_sah_cost >= 0))
    corrupt("its costs are not positive numbers");
  const uint64_t leaf_words =
      data.reference_count == 0
          ? 0
          : uint64_t{data.reference_count} * data.reference_words() + kLeafPadding;
  const uint64_t node_bytes = uint64_t{4} * data.node_words();
  if (file.bytes(0) % node_bytes != 0 || file.bytes(0) / 4 > kMaxNodeWords ||
      file.bytes(1) != 4 * leaf_words || file.bytes(2) % sizeof(Vec3) != 0 ||
      (!data.compact && file.bytes(2) != 0) || (file.bytes(0) == 0) != (data.reference_count == 0))
    corrupt("its arrays do not have the sizes that its header asks for");
}

/// Calls change(link) for every link to a node.
template <typename Change>
void change_links(const BvhData& data, BigVector<uint32_t>& nodes, const Change& change) {
  for (size_t at = data.links_at(); at < nodes.size(); at += data.node_words())
    for (uint32_t slot = 0; slot < data.width; ++slot)
      if (!LeafStore::is_leaf(nodes[at + slot])) change(nodes[at + slot]);
}

/// As in a file: links to nodes are their numbers. Every node reached once from one before it,
/// every leaf within the references, and no more of either than the header says.
class TreeChecker {
 public:
  explicit TreeChecker(const BvhData& data)
      : data_(data), depth_(data.node_count(), 0), is_covered_(data.reference_count, 0) {}

  void run() {
    for (uint32_t node = 0; node < data_.node_count(); ++node) {
      if (node > 0 && depth_[node] == 0) fail(node, "is not reached from the root");
      check_node(node);
    }
    if (leaves_ != data_.leaf_count || covered_ != data_.reference_count ||
        deepest_ != data_.max_depth)
      corrupt("its leaves are not those that its header counts");
  }

 private:
  [[noreturn]] static void fail(uint32_t node, const char* what) {
    corrupt("node " + std::to_string(node) + " " + what);
  }

  void check_node(uint32_t node) {
    bool is_empty_node = true;
    if (data_.quantised && !grid::is_grid(data_.node_at(node))) fail(node, "has no sound grid");
    for (uint32_t slot = 0; slot < data_.width; ++slot) {
      const uint32_t link = data_.link(node, slot);
      const Aabb box = data_.box(node, slot);
      if (has_nan(box)) fail(node, "has a box that is not a number");
      if (link == kNoChild) continue;
      is_empty_node = false;
      if (!is_finite(box.min) || !is_finite(box.max) || is_empty(box))
        fail(node, "has a box that is empty or not finite");
      deepest_ = std::max(deepest_, depth_[node] + 1);
      if (BvhData::is_leaf(link))
        check_leaf(node, link, box);
      else
        check_child(node, link, box);
    }
    if (is_empty_node) fail(node, "has no children");
  }

  static bool has_nan(const Aabb& box) {
    const float sum = (box.min.x * 0 + box.min.y * 0 + box.min.z * 0) +
                      (box.max.x * 0 + box.max.y * 0 + box.max.z * 0);
    if (sum == 0) return false;
    return std::isnan(box.min.x) || std::isnan(box.min.y) || std::isnan(box.min.z) ||
           std::isnan(box.max.x) || std::isnan(box.max.y) || std::isnan(box.max.z);
  }

  void check_child(uint32_t node, uint32_t child, const Aabb& box) {
    if (child <= node || child >= data_.node_count()) fail(node, "has a child out of range");
    if (depth_[child] != 0) fail(child, "has two parents");
    depth_[child] = depth_[node] + 1;
    if (depth_[child] > kMaxTraversalDepth) fail(child, "is too deep");
    // Boxes on a grid are rounded outwards, and so may reach a little out of those above them.
    if (data_.quantised) return;
    for (uint32_t slot = 0; slot < data_.width; ++slot) {
      if (data_.link(child, slot) == kNoChild) continue;
      Aabb both = data_.box(child, slot);
      extend(both, box);
      if (!(both == box)) fail(child, "reaches out of its parent's box");
    }
  }

  void check_leaf(uint32_t node, uint32_t link, const Aabb& box) {
    Aabb both = data_.bounds;
    extend(both, box);
    if (!data_.quantised && !(both == data_.bounds)) fail(node, "reaches out of the bounds");
    const uint32_t size = BvhData::leaf_size(link);
    const uint64_t first = BvhData::first_reference(link);
    if (first + size > data_.reference_count) fail(node, "has a leaf out of range");
    for (uint64_t i = first; i < first + size; ++i) {
      if (is_covered_[i]) fail(node, "has a leaf that overlaps another");
      is_covered_[i] = 1;
    }
    covered_ += size;
    ++leaves_;
    check_triangles(node, link);
  }

  void check_triangles(uint32_t node, uint32_t link) const {
    const uint32_t n = BvhData::leaf_size(link), rows = data_.corner_words();
    const uint32_t* const words =
        data_.leaves.data() + size_t{BvhData::first_reference(link)} * data_.reference_words();
    for (uint32_t i = 0; i < rows * n; ++i) {
      const bool fits = data_.compact ? words[i] < data_.vertices.size()
                                      : std::isfinite(std::bit_cast<float>(words[i]));
      if (!fits) fail(node, "has a leaf with a corner that is not finite or not there");
    }
    for (uint32_t i = 0; i < n; ++i)
      if (words[rows * n + i] >= data_.triangle_count)
        fail(node, "has a leaf with a triangle out of range");
  }

  const BvhData& data_;
  std::vector<uint32_t> depth_;
  std::vector<uint8_t> is_covered_;
  uint32_t leaves_ = 0, covered_ = 0, deepest_ = 0;
};

void check_tree(const BvhData& data) {
  for (size_t i = 0; i < data.vertices.size(); ++i)
    if (!is_finite(data.vertices[i])) corrupt("vertex " + std::to_string(i) + " is not finite");
  if (data.nodes.empty()) {
    if (data.leaf_count != 0 || data.max_depth != 0 || !is_empty(data.bounds))
      corrupt("it has no nodes, but is not empty");
    return;
  }
  if (!is_finite(data.bounds.min) || !is_finite(data.bounds.max) || is_empty(data.bounds))
    corrupt("its bounds are empty or not finite");
  TreeChecker(data).run();
}

BvhData read_umbvh(const std::string& path) {
  const ContainerFile file(path, kUmbvh);
  BvhData data = decode_bvh(file.fields());
  check_header(data, file);
  data.nodes.resize(file.bytes(0) / 4);
  data.leaves.resize(file.bytes(1) / 4);
  data.vertices.resize(file.bytes(2) / sizeof(Vec3));
  file.read(container_arrays(data.nodes, data.leaves, data.vertices));
  check_tree(data);
  change_links(data, data.nodes, [&](uint32_t& link) { link = data.node_link(link); });
  return data;
}

}  // namespace

void Bvh::save(const std::string& path) const {
  const Data& d = data();
  BigVector<uint32_t> nodes = d.nodes;
  change_links(d, nodes, [&](uint32_t& link) { link = d.linked_node(link); });
  write_container(path, kUmbvh, encode(d), container_bytes(nodes, d.leaves, d.vertices));
}

Bvh Bvh::load(const std::string& path, Simd simd) {
  Bvh result;
  static_cast<BvhData&>(result.data()) = reading(path, [&] { return read_umbvh(path); });
  prepare_rays(result.data(), simd);
  return result;
}

}  // namespace umbel
