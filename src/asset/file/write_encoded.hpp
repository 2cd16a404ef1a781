// Writes a file from groups that are encoded already, page after page, wherever their bytes are.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

#include "asset/codec/vertex_codec.hpp"
#include "asset/file/page_plan.hpp"
#include "base/file.hpp"
#include "base/progress.hpp"
#include "umbel/asset.hpp"

namespace umbel::asset {

/// A mesh but for the chunks of its groups.
struct EncodedMesh {
  AssetMesh mesh;
  VertexFormat format;
  uint32_t max_triangles = 0, max_vertices = 0;  ///< of a cluster, as the build was asked
  std::vector<Range> levels;
  std::vector<lod::Node> nodes;
  std::vector<GroupEntry> groups;
};

/// Gives the chunk of a group, as encode_chunk made it. Each is asked for once, in the order of the
/// file.
using ChunkReader = std::function<std::vector<std::byte>(const GroupName&)>;

/// Refuses a configuration, or contents apart from their meshes, that are out of range.
void check_contents(const AssetContents& contents, const AssetConfig& config, size_t meshes);
/// A mesh's material numbers begin here.
uint32_t first_material(const AssetContents& contents, size_t mesh);

/// Writes the whole file, which the caller commits. `contents.meshes` is not looked at, and all has
/// been checked. Progress goes from `begun` to 1. Returns the bytes written.
uint64_t write_encoded(OutputFile& file, const AssetContents& contents,
                       std::vector<EncodedMesh> meshes, uint32_t page_bytes,
                       const ChunkReader& read_chunk, Progress& progress, double begun);

}  // namespace umbel::asset
