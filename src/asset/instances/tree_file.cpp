#include "asset/instances/tree_file.hpp"

#include <cmath>
#include <string>

#include "base/bytes.hpp"
#include "base/math.hpp"

namespace umbel::asset {
namespace {

constexpr uint64_t kPageHeadBytes = 16, kPlacementBytes = 52;
constexpr uint32_t kMostLevels = 64;  // those that walk the tree call themselves for each

[[noreturn]] void wrong_node(uint32_t node, const std::string& what) {
  corrupt("node " + std::to_string(node) + " of the instances " + what);
}

uint32_t placements_in(uint32_t page_bytes) {
  if (page_bytes < kPageHeadBytes || (page_bytes - kPageHeadBytes) % kPlacementBytes != 0)
    return kNone;
  return static_cast<uint32_t>((page_bytes - kPageHeadBytes) / kPlacementBytes);
}

bool is_number(float value) { return std::isfinite(value) && value >= 0; }

void check_values(uint32_t n, const InstanceNode& node, const PlacementPage& page,
                  uint64_t page_bytes) {
  if (!is_finite(node.sphere.center) || !is_number(node.sphere.radius) || !is_number(node.error) ||
      !is_number(node.coarsest_error))
    wrong_node(n, "has a sphere or an error that is no finite number");
  if (node.placements == kNone || page.offset > page_bytes || page.bytes > page_bytes - page.offset)
    wrong_node(n, "has a page of " + std::to_string(page.bytes) + " bytes at byte " +
                      std::to_string(page.offset) + " of " + std::to_string(page_bytes));
}

/// Nodes follow each other level by level, and a page has the stand-ins of all children in turn.
void check_structure(const std::vector<InstanceNode>& nodes, size_t top_instances) {
  uint64_t next = 1, level_end = 1;
  uint32_t levels = 1;
  if (nodes[0].stand_ins != Range{0, static_cast<uint32_t>(top_instances)})
    wrong_node(0, "does not have the listed instances as its stand-ins");
  for (uint32_t n = 0; n < nodes.size(); ++n) {
    const InstanceNode& node = nodes[n];
    if (n == level_end) {
      level_end = next;
      if (++levels > kMostLevels)
        wrong_node(n, "is below " + std::to_string(kMostLevels) + " levels of others");
    }
    if (node.children.count == 0) {
      if (node.instances != node.placements) wrong_node(n, "has not all its instances in its page");
      continue;
    }
    if (node.children.offset != next || node.children.count > nodes.size() - next)
      wrong_node(n, "has children that are not the next nodes");
    uint64_t placements = 0, instances = 0;
    for (uint64_t c = next; c < next + node.children.count; ++c) {
      if (nodes[c].stand_ins.offset != placements || !(nodes[c].error <= node.error))
        wrong_node(n, "does not agree with its child " + std::to_string(c));
      placements += nodes[c].stand_ins.count;
      instances += nodes[c].instances;
    }
    if (placements != node.placements || instances != node.instances)
      wrong_node(n, "does not have as many placements as its children");
    next += node.children.count;
  }
  if (next != nodes.size()) corrupt("the instances' nodes are no tree");
}

}  // namespace

std::vector<std::byte> encode_placements(uint32_t node, std::span<const Instance> placements) {
  std::vector<std::byte> bytes(kPageHeadBytes + kPlacementBytes * placements.size());
  ByteWriter out(bytes);
  out.u32(node);
  out.u32(static_cast<uint32_t>(placements.size()));
  out.u64(0);
  for (const Instance& placement : placements) {
    for (const float f : placement.transform.rows) out.f32(f);
    out.u32(placement.mesh);
  }
  return bytes;
}

std::vector<Instance> decode_placements(std::span<const std::byte> page, uint32_t node,
                                        uint32_t count, size_t meshes) {
  ByteReader in(page);
  if (in.u32() != node || in.u32() != count || in.u64() != 0 ||
      page.size() != kPageHeadBytes + kPlacementBytes * count)
    wrong_node(node, "has a page that says something else");
  std::vector<Instance> placements(count);
  for (Instance& placement : placements) {
    for (float& f : placement.transform.rows) {
      f = in.f32();
      if (!std::isfinite(f)) wrong_node(node, "has a transform that is not finite");
    }
    placement.mesh = in.u32();
    if (placement.mesh >= meshes)
      wrong_node(node, "has an instance of mesh " + std::to_string(placement.mesh) +
                           ", but there are " + std::to_string(meshes));
  }
  return placements;
}

std::vector<std::byte> encode_instance_nodes(const StoredInstanceTree& tree) {
  std::vector<std::byte> bytes(kInstanceNodeBytes * tree.nodes.size());
  ByteWriter out(bytes);
  for (size_t n = 0; n < tree.nodes.size(); ++n) {
    const InstanceNode& node = tree.nodes[n];
    const PlacementPage& page = tree.pages[n];
    out.vec3(node.sphere.center);
    out.f32(node.sphere.radius);
    out.f32(node.error);
    out.f32(node.coarsest_error);
    out.u32(node.children.offset);
    out.u32(node.children.count);
    out.u32(node.stand_ins.offset);
    out.u32(node.stand_ins.count);
    out.u64(page.offset);
    out.u32(page.bytes);
    out.u32(node.instances);
    out.u64(page.checksum);
  }
  return bytes;
}

StoredInstanceTree decode_instance_nodes(std::span<const std::byte> bytes, uint64_t count,
                                         uint32_t element_bytes, uint64_t page_bytes,
                                         size_t top_instances) {
  StoredInstanceTree tree;
  ByteReader in(bytes);
  for (uint64_t n = 0; n < count; ++n) {
    in.skip_to(n * element_bytes);
    InstanceNode node{};
    PlacementPage page{};
    node.sphere.center = in.vec3();
    node.sphere.radius = in.f32();
    node.error = in.f32();
    node.coarsest_error = in.f32();
    node.children = in.range();
    node.stand_ins = in.range();
    page.offset = in.u64();
    page.bytes = in.u32();
    node.instances = in.u32();
    page.checksum = in.u64();
    node.placements = placements_in(page.bytes);
    check_values(static_cast<uint32_t>(n), node, page, page_bytes);
    tree.nodes.push_back(node);
    tree.pages.push_back(page);
  }
  if (count > 0) check_structure(tree.nodes, top_instances);
  return tree;
}

}  // namespace umbel::asset
