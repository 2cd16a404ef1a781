#include "scale/partition.hpp"

#include <algorithm>
#include <span>

#include "base/bytes.hpp"

namespace umbel::scale {
namespace {

constexpr uint32_t kPartMagic = 0x54524150;  // "PART"
constexpr size_t kGridBytes = 28, kNodeBytes = 20, kPartHeaderBytes = 16;

uint32_t along(float low, float high, float value, uint32_t resolution) {
  const double size = double{high} - low;
  if (!(size > 0)) return 0;
  const double at = (double{value} - low) / size * resolution;
  if (!(at > 0)) return 0;
  return std::min(static_cast<uint32_t>(std::min(at, 4e9)), resolution - 1);
}

}  // namespace

std::array<uint32_t, 3> CellGrid::cell_of(const Vec3& p) const {
  return {along(low.x, high.x, p.x, resolution), along(low.y, high.y, p.y, resolution),
          along(low.z, high.z, p.z, resolution)};
}

CellGrid CellGrid::within(const std::array<uint32_t, 3>& cell, uint32_t cells) const {
  const auto at = [&](float from, float to, uint32_t k) {
    return static_cast<float>(from + (double{to} - from) * k / resolution);
  };
  return {{at(low.x, high.x, cell[0]), at(low.y, high.y, cell[1]), at(low.z, high.z, cell[2])},
          {at(low.x, high.x, cell[0] + 1), at(low.y, high.y, cell[1] + 1),
           at(low.z, high.z, cell[2] + 1)},
          cells};
}

uint32_t Partition::leaf(const Vec3& centroid) const {
  uint32_t at = 0;
  std::array<uint32_t, 3> cell = grids_[0].cell_of(centroid);
  while (nodes_[at].kind != Kind::kUnit) {
    const Node& node = nodes_[at];
    if (node.kind == Kind::kGrid) {
      cell = grids_[node.first].cell_of(centroid);
      at = node.second;
    } else {
      at = cell[node.axis] < node.plane ? node.first : node.second;
    }
  }
  return at;
}

uint32_t Partition::shared_leaves() const {
  return static_cast<uint32_t>(std::count_if(nodes_.begin(), nodes_.end(), [](const Node& n) {
    return n.kind == Kind::kUnit && n.second > 1;
  }));
}

std::vector<std::byte> Partition::bytes() const {
  std::vector<std::byte> bytes(kPartHeaderBytes + grids_.size() * kGridBytes +
                               nodes_.size() * kNodeBytes);
  ByteWriter out(bytes);
  out.u32(kPartMagic);
  out.u32(units_);
  out.u32(static_cast<uint32_t>(grids_.size()));
  out.u32(static_cast<uint32_t>(nodes_.size()));
  for (const CellGrid& grid : grids_) {
    out.vec3(grid.low);
    out.vec3(grid.high);
    out.u32(grid.resolution);
  }
  for (const Node& n : nodes_)
    for (uint32_t word : {static_cast<uint32_t>(n.kind), n.axis, n.plane, n.first, n.second})
      out.u32(word);
  return bytes;
}

Partition Partition::from_bytes(std::span<const std::byte> bytes) {
  ByteReader in(bytes);
  if (in.u32() != kPartMagic) corrupt("this is no partition into units");
  Partition partition;
  partition.units_ = in.u32();
  const uint64_t grids = in.u32(), nodes = in.u32();
  if (bytes.size() != kPartHeaderBytes + grids * kGridBytes + nodes * kNodeBytes || nodes == 0)
    corrupt("a partition into units has another size than it says");
  partition.grids_.clear();
  partition.nodes_.clear();
  for (uint64_t k = 0; k < grids; ++k) {
    const Vec3 low = in.vec3(), high = in.vec3();
    partition.grids_.push_back({low, high, std::max(in.u32(), 1u)});
  }
  for (uint32_t k = 0; k < nodes; ++k) {
    const uint32_t kind = in.u32(), axis = in.u32(), plane = in.u32();
    const Node node{static_cast<Kind>(kind), axis, plane, in.u32(), in.u32()};
    // Children come after their parents, so that every way down ends.
    const bool good = node.kind == Kind::kPlane ? axis < 3 && node.first > k && node.second > k &&
                                                      node.first < nodes && node.second < nodes
                      : node.kind == Kind::kGrid
                          ? node.first < grids && node.second > k && node.second < nodes
                          : node.kind == Kind::kUnit && node.second > 0 &&
                                node.first < partition.units_ &&
                                node.second <= partition.units_ - node.first;
    if (!good) corrupt("a partition into units has a node that leads nowhere");
    partition.nodes_.push_back(node);
  }
  return partition;
}

}  // namespace umbel::scale
