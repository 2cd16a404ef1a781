// Encodes the groups of a unit for the asset: in the process that writes it, or as tasks of any
// machines, which leave a file of chunks a unit.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

#include "asset/codec/vertex_codec.hpp"
#include "scale/parts.hpp"
#include "scale/tiers.hpp"

namespace umbel::scale {

/// A unit's groups of one level, which have consecutive numbers in the asset.
struct Run {
  uint32_t level;         ///< as the units count
  uint32_t first, count;  ///< of the unit's groups
  uint32_t number;        ///< of the first, in the asset
};

/// What the chunks of all units depend on, once the summaries of all are known. What is one value
/// is an array of one.
struct EncodePlan {
  std::vector<asset::AttributeFormat> attributes;
  std::vector<uint8_t> is_smooth;
  std::vector<Aabb> bounds;  ///< of all clusters
  std::vector<uint32_t> first_material;
  std::vector<uint32_t> has_materials;  ///< vertices have them, since clusters mix them
  std::vector<Run> runs;                ///< by serial number of the unit, in each by level
  std::vector<uint32_t> first_run;      ///< of each unit, and one past the last
  std::vector<uint32_t> first_serial;   ///< of each tier

  uint32_t number_of(uint32_t serial, uint32_t group) const;
};

/// Names the plan, and what is made by it: another has another.
uint64_t hash_of(EncodePlan& plan);
void write_encode_plan(const std::filesystem::path& path, EncodePlan& plan);

/// A block of a unit's parts.
struct BlockName {
  uint32_t serial, block;
  uint32_t first_group;  ///< of the unit
  uint32_t groups;
};

/// The chunks of a block's groups, one after the other.
struct EncodedBlock {
  std::vector<std::byte> bytes;
  std::vector<uint32_t> references, chunk_bytes;  ///< of each
};

/// `clusters`: of each of the block's groups.
EncodedBlock encode_block(const EncodePlan& plan, const BlockName& name,
                          const std::filesystem::path& parts, std::span<const uint32_t> clusters);

/// All blocks of a unit, to its chunks_file.
void encode_unit(const std::filesystem::path& work, const Task& task);
EncodedBlock read_encoded(const std::filesystem::path& chunks, uint32_t block);

}  // namespace umbel::scale
