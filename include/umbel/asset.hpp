// A .umbel file: one continuous-LOD asset, read page by page. docs/format.md has every byte.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>

#include "umbel/lod.hpp"

namespace umbel {

struct AssetInfo {
  uint16_t version_major = 2, version_minor = 0;
  uint64_t file_bytes = 0;
  uint32_t pages = 0;
  bool normals = false, tangents = false, uvs = false, colors = false;
  float position_step = 0;  ///< positions are multiples of it; 0: any floats
  float uv_step = 0;        ///< likewise
  uint32_t normal_bits = 0, tangent_bits = 0, color_bits = 0;  ///< see AssetConfig; 0: floats
  Aabb bounds;
  uint64_t source_triangles = 0, source_vertices = 0, source_digest = 0;
  uint32_t max_triangles = 0, max_vertices = 0;  ///< limits that every cluster keeps
  std::string metadata;                          ///< JSON, as given to write_asset
};

/// How exactly attributes are kept; 0 everywhere, and for those that do not fit (colours outside
/// [0, 1]): as the floats that they are. Positions are stored exactly, and small where
/// lod::Config::position_step put them on a grid.
struct AssetConfig {
  uint32_t normal_bits = 10;   ///< of each of two octahedral components, 2..16
  uint32_t tangent_bits = 10;  ///< of the angle about the normal, 2..16; needs normal_bits
  uint32_t color_bits = 8;     ///< of red, green, blue (as sRGB) and alpha, 2..16
  float uv_step = 0x1p-14f;    ///< texture coordinates become multiples of this power of two

  static AssetConfig exact() { return {0, 0, 0, 0}; }
};

/// Writes beside `path` and renames, so that a file of that name is always whole. `metadata` is
/// a JSON object that comes back as AssetInfo::metadata. Returns the bytes written. Throws kIo,
/// kCancelled, and kInvalidArgument for a DAG that cannot be stored (a range or index out of its
/// table, clusters not in one group each, nodes that are no tree). A DAG that is merely wrong
/// (an error too low, a triangle missing) is stored as it is; verify_asset tells.
UMBEL_API uint64_t write_asset(const std::filesystem::path& path, const lod::Dag& dag,
                               const std::string& metadata = "{}", const BuildOptions& options = {},
                               const AssetConfig& config = {});

/// An open asset: tables in memory, pages read when asked for. Safe to use from many threads.
class UMBEL_API Asset {
 public:
  /// Reads and checks header and tables. Throws kIo, kCorrupt, kUnsupported (a newer version).
  explicit Asset(const std::filesystem::path& path);
  Asset(Asset&&) noexcept;
  Asset& operator=(Asset&&) noexcept;
  ~Asset();

  const AssetInfo& info() const;
  const lod::Tables& tables() const;
  /// Reads one cluster out of its page. Throws kCorrupt if the page's checksum does not hold.
  lod::ClusterGeometry geometry(uint32_t cluster) const;
  /// Whether the page of this group holds what its checksum says.
  bool page_is_whole(uint32_t group) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// Everything that lod::verify checks, and every page's checksum. A file that cannot be opened
/// as an asset at all gives a report with checksum_errors and the sentence, not an exception,
/// unless it does not exist.
UMBEL_API lod::VerifyReport verify_asset(const std::filesystem::path& path, uint32_t cuts = 64,
                                         uint32_t seed = 1, const BuildOptions& options = {});

}  // namespace umbel
