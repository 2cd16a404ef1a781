#include "asset/file/chunk_tables.hpp"

#include <algorithm>
#include <string>

#include "base/bits.hpp"
#include "base/bytes.hpp"

namespace umbel::asset {
namespace {

/// Bits of a width that is at most 32, and of one that is at most 16.
constexpr uint32_t kWidthBits = 6, kShortWidthBits = 5;
constexpr uint32_t kComponentBits = 32 + kWidthBits;
constexpr uint32_t kAxisBits = 16 + 2 * kShortWidthBits;
constexpr uint32_t kRecordsHeaderBits = kWidthBits + 32 + kWidthBits + 3 * kAxisBits;

/// How wide the fields of records are, and where those with a lowest value begin.
struct RecordWidths {
  uint32_t bytes = 0, reference = 0, material = 0;
  uint32_t lowest_material = 0;
  struct Axis {
    uint16_t lowest = 0xffff;
    uint32_t corner = 0, extent = 0;
  };
  std::array<Axis, 3> axes;

  uint64_t record_bits() const {
    uint64_t bits = uint64_t{bytes} + 8 + 8 + reference + material;
    for (const Axis& axis : axes) bits += axis.corner + axis.extent;
    return bits;
  }
};

uint32_t width_of(uint32_t value) { return static_cast<uint32_t>(std::bit_width(value)); }

/// Modulo 2^16, for boxes that no file of ours has.
uint16_t extent_of(const ClusterRecord& cluster, size_t axis) {
  return static_cast<uint16_t>(cluster.box[axis + 3] - cluster.box[axis]);
}

RecordWidths widths_of(std::span<const ClusterRecord> clusters, uint32_t references) {
  RecordWidths widths;
  widths.reference = bits_below(references + 1);
  if (clusters.empty()) return widths;
  widths.lowest_material = ~0u;
  for (const ClusterRecord& c : clusters) {
    widths.lowest_material = std::min(widths.lowest_material, c.material);
    for (size_t k = 0; k < 3; ++k)
      widths.axes[k].lowest = std::min(widths.axes[k].lowest, c.box[k]);
  }
  for (const ClusterRecord& c : clusters) {
    widths.bytes = std::max(widths.bytes, width_of(c.bytes));
    widths.material = std::max(widths.material, width_of(c.material - widths.lowest_material));
    for (size_t k = 0; k < 3; ++k) {
      RecordWidths::Axis& axis = widths.axes[k];
      axis.corner = std::max(axis.corner, width_of(c.box[k] - uint32_t{axis.lowest}));
      axis.extent = std::max(axis.extent, width_of(extent_of(c, k)));
    }
  }
  return widths;
}

void write_widths(const RecordWidths& widths, BitWriter& out) {
  out.write(widths.bytes, kWidthBits);
  out.write(widths.lowest_material, 32);
  out.write(widths.material, kWidthBits);
  for (const RecordWidths::Axis& axis : widths.axes) {
    out.write(axis.lowest, 16);
    out.write(axis.corner, kShortWidthBits);
    out.write(axis.extent, kShortWidthBits);
  }
}

RecordWidths read_widths(BitReader& in, uint32_t references) {
  RecordWidths widths;
  widths.reference = bits_below(references + 1);
  widths.bytes = in.read(kWidthBits);
  widths.lowest_material = in.read(32);
  widths.material = in.read(kWidthBits);
  bool fit = widths.bytes <= 32 && widths.material <= 32;
  for (RecordWidths::Axis& axis : widths.axes) {
    axis.lowest = static_cast<uint16_t>(in.read(16));
    axis.corner = in.read(kShortWidthBits);
    axis.extent = in.read(kShortWidthBits);
    fit = fit && axis.corner <= 16 && axis.extent <= 16;
  }
  if (!fit) corrupt("a group's tables have fields of impossible widths");
  return widths;
}

void write_record(const ClusterRecord& cluster, const RecordWidths& widths, BitWriter& out) {
  out.write(cluster.bytes, widths.bytes);
  out.write(cluster.vertices - 1, 8);
  out.write(cluster.triangles - 1, 8);
  out.write(cluster.reference == kNone ? 0 : cluster.reference + 1, widths.reference);
  out.write(cluster.material - widths.lowest_material, widths.material);
  for (size_t k = 0; k < 3; ++k) {
    out.write(cluster.box[k] - uint32_t{widths.axes[k].lowest}, widths.axes[k].corner);
    out.write(extent_of(cluster, k), widths.axes[k].extent);
  }
}

ClusterRecord read_record(const RecordWidths& widths, uint32_t references, BitReader& in) {
  ClusterRecord cluster;
  cluster.bytes = in.read(widths.bytes);
  cluster.vertices = in.read(8) + 1;
  cluster.triangles = in.read(8) + 1;
  cluster.reference = in.read(widths.reference) - 1;  // 0: none
  cluster.material = widths.lowest_material + in.read(widths.material);
  for (size_t k = 0; k < 3; ++k) {
    const uint32_t corner = widths.axes[k].lowest + in.read(widths.axes[k].corner);
    cluster.box[k] = static_cast<uint16_t>(corner);
    cluster.box[k + 3] = static_cast<uint16_t>(corner + in.read(widths.axes[k].extent));
  }
  if (cluster.reference != kNone && cluster.reference >= references)
    corrupt("a cluster was made from group " + std::to_string(cluster.reference) + " of " +
            std::to_string(references));
  return cluster;
}

void check_width(const ComponentRange& range) {
  if (range.bits > 32) corrupt("a group's components have " + std::to_string(range.bits) + " bits");
}

[[noreturn]] void too_long() { corrupt("a group's tables are longer than its chunk"); }

}  // namespace

void write_tables(const PackedTables& tables, uint32_t references, std::vector<std::byte>& out) {
  BitWriter bits(out);
  for (const ComponentRange& range : tables.ranges) {
    bits.write(static_cast<uint32_t>(range.lowest), 32);
    bits.write(range.bits, kWidthBits);
  }
  const RecordWidths widths = widths_of(tables.clusters, references);
  write_widths(widths, bits);
  for (const ClusterRecord& cluster : tables.clusters) write_record(cluster, widths, bits);
  bits.finish();
}

PackedTables read_tables(std::span<const std::byte> chunk, const TableCounts& counts) {
  const uint64_t header_bits = uint64_t{kComponentBits} * counts.components + kRecordsHeaderBits;
  if (header_bits > 8 * chunk.size()) too_long();
  PackedTables tables;
  BitReader in(chunk);
  tables.ranges.resize(counts.components);
  for (ComponentRange& range : tables.ranges) {
    range.lowest = static_cast<int32_t>(in.read(32));
    range.bits = in.read(kWidthBits);
    check_width(range);
  }
  const RecordWidths widths = read_widths(in, counts.references);
  tables.bytes = (header_bits + widths.record_bits() * counts.clusters + 7) / 8;
  if (tables.bytes > chunk.size()) too_long();
  tables.clusters.reserve(counts.clusters);
  for (uint32_t i = 0; i < counts.clusters; ++i)
    tables.clusters.push_back(read_record(widths, counts.references, in));
  return tables;
}

PackedTables read_tables_3(std::span<const std::byte> chunk, const TableCounts& counts) {
  constexpr uint64_t kComponentBytes = 8, kRecordBytes = 24;
  constexpr uint32_t kNoReference = 0xffff;
  PackedTables tables;
  tables.bytes = kComponentBytes * counts.components + kRecordBytes * counts.clusters;
  if (tables.bytes > chunk.size()) too_long();
  ByteReader in(chunk);
  tables.ranges.resize(counts.components);
  for (ComponentRange& range : tables.ranges) {
    range.lowest = static_cast<int32_t>(in.u32());
    range.bits = in.u32();
    check_width(range);
  }
  // The ends of clusters' data are from the start of the chunk, whose references come first.
  const uint64_t before = uint64_t{32} * counts.references;
  uint64_t begin = before + tables.bytes;
  tables.clusters.resize(counts.clusters);
  for (ClusterRecord& cluster : tables.clusters) {
    const uint64_t end = in.u32();
    const uint32_t sizes = in.u16(), reference = in.u16();
    if (end < begin || end - before > chunk.size())
      corrupt("a cluster's data lie outside its group's chunk");
    cluster.bytes = static_cast<uint32_t>(end - begin);
    begin = end;
    cluster.vertices = (sizes & 0xff) + 1;
    cluster.triangles = (sizes >> 8) + 1;
    cluster.reference = reference == kNoReference ? kNone : reference;
    cluster.material = in.u32();
    for (uint16_t& step : cluster.box) step = in.u16();
    if (cluster.reference != kNone && cluster.reference >= counts.references)
      corrupt("a cluster was made from group " + std::to_string(reference) + " of " +
              std::to_string(counts.references));
  }
  return tables;
}

}  // namespace umbel::asset
