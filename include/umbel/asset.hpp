// Assets: .umbel files of meshes with continuous level of detail, read page by page. docs/format.md
// specifies every byte.
//
//   write_asset("dragon.umbel", lod::build(mesh.view()));
//   const Asset asset("dragon.umbel");
//   asset.walk(view, [&](const CutGroup& group) {  // reads the pages that the view needs
//     const std::vector<lod::ClusterGeometry> all = asset.decode(group.page, group.index);
//     for (const uint32_t c : group.clusters) draw(all[c]);
//   });
//
//   const auto cut = lod::select_hierarchy(asset.tables(), view);  // reads all tables, once
//   const lod::ClusterGeometry geometry = asset.geometry(cut[0]);
//
// To stream an asset under a budget of bytes, see stream.hpp.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "umbel/lod/build.hpp"
#include "umbel/lod/select.hpp"
#include "umbel/lod/verify.hpp"

namespace umbel {

struct AssetInfo {
  uint16_t version_major = 6, version_minor = 0;
  uint64_t file_bytes = 0;
  uint64_t header_bytes = 0;  ///< what opening reads
  /// A hash of the whole file: the checksum of the fixed header, which covers all other checksums.
  uint64_t checksum = 0;
  uint32_t pages = 0;
  uint32_t page_bytes = 0;                       ///< largest page, unless one group takes more
  uint32_t max_triangles = 0, max_vertices = 0;  ///< limits that every cluster keeps
  std::string metadata;                          ///< JSON, as given to write_asset

  // Attributes are those of the first mesh, sums and bounds those of all meshes.
  bool normals = false, tangents = false, uvs = false, colors = false;
  float position_step = 0;  ///< positions are multiples of it; 0: any floats
  float uv_step = 0;        ///< likewise
  uint32_t normal_bits = 0, tangent_bits = 0, color_bits = 0;  ///< see AssetConfig; 0: floats
  Aabb bounds;  ///< of the meshes, each in its own space, relative to `origin`
  /// A point of the asset is at origin + point in the world.
  Vec3d origin{};
  uint64_t source_triangles = 0, source_vertices = 0;
  uint64_t source_digest = 0;  ///< the sum of the meshes' digests
};

/// One of an asset's meshes. Its groups, clusters and nodes are numbered from 0.
struct AssetMesh {
  Aabb bounds;
  uint64_t source_triangles = 0, source_vertices = 0, source_digest = 0;
  uint32_t groups = 0, clusters = 0;
  bool normals = false, tangents = false, uvs = false, colors = false;
};

/// A mesh in the scene.
struct Instance {
  uint32_t mesh;
  Transform transform{};  ///< from the mesh's space to the scene's
  bool operator==(const Instance&) const = default;
};

/// A node of the tree of an asset's instances: see instance_tree.hpp.
struct InstanceNode {
  Sphere sphere;         ///< contains all instances and stand-ins below it
  float error;           ///< of its stand-ins, in the scene's unit; at least its children's
  float coarsest_error;  ///< that the placements of its page have with their coarsest clusters
  Range children;        ///< consecutive nodes; none for a leaf
  Range stand_ins;       ///< in the page of its parent; of the root in Asset::instances()
  uint32_t instances;    ///< below it
  uint32_t placements;   ///< in its page: a leaf's instances, or the stand-ins of its children
  bool operator==(const InstanceNode&) const = default;
};

/// What a tree of instances knows of a mesh.
struct InstancedMesh {
  Aabb bounds;
  float coarsest_error;  ///< of its coarsest clusters; 0 if nothing is finer
};

/// A reference to a group, from a coarser group that was made from it, or from the roots.
struct GroupRef {
  uint32_t group;
  uint32_t page;     ///< the page that has the group
  uint32_t parents;  ///< how many groups have clusters made from it
  Sphere sphere;     ///< this and the error are the group's own
  float error;
  bool operator==(const GroupRef&) const = default;
};

/// What is there once a group is refined: its clusters, by the groups that they were made from.
struct Refinement {
  struct Part {
    GroupRef group;
    uint32_t triangles;  ///< of the clusters that were made from it
    bool operator==(const Part&) const = default;
  };
  std::vector<Part> parts;
  uint32_t triangles = 0;  ///< of clusters that were made from no group
  bool operator==(const Refinement&) const = default;
};

/// A group of a page.
struct PageGroup {
  uint32_t mesh, id;  ///< of Asset::meshes(), and in that mesh's tables
  lod::Group group;
  uint32_t parents;                    ///< how many groups have clusters made from it
  std::vector<GroupRef> children;      ///< the groups that its clusters were made from
  std::vector<lod::Cluster> clusters;  ///< the mesh's clusters group.clusters
  uint32_t offset, bytes;              ///< of its chunk, in the page
};

/// A page in memory, checked.
struct AssetPage {
  uint32_t index = 0;
  std::vector<PageGroup> groups;
  std::vector<std::byte> bytes;
};

/// A group with clusters in the cut that Asset::walk looks for.
struct CutGroup {
  const AssetPage& page;
  uint32_t index;                      ///< the group is page.groups[index]
  std::span<const uint32_t> clusters;  ///< those in the cut, of page.groups[index].clusters
};
/// Gets each group once. The page stays for the call only.
using CutVisitor = std::function<void(const CutGroup&)>;

struct WalkReport {
  uint64_t pages = 0;                                ///< read
  uint64_t cut_pages = 0;                            ///< of these, pages with clusters of the cut
  uint64_t groups = 0, clusters = 0, triangles = 0;  ///< of the cut
  float error = 0;  ///< the largest of the groups that the cut stands for, 0 for level 0 alone
};

/// What all pages together say of a mesh.
struct MeshSummary {
  uint64_t triangles = 0;  ///< of all levels
  uint64_t root_groups = 0, root_clusters = 0, root_triangles = 0;
  uint32_t max_triangles = 0, max_vertices = 0;  ///< of a cluster
  uint32_t max_material = 0;
};

/// How exactly attributes are stored. 0 stores floats unchanged, and so do values out of range
/// (colours outside [0, 1]). Positions are always exact, and take fewer bits if
/// lod::Config::position_step snapped them to a grid.
struct AssetConfig {
  uint32_t normal_bits = 10;   ///< of each of two octahedral components, 2..16
  uint32_t tangent_bits = 10;  ///< of the angle about the normal, 2..16; needs normal_bits
  uint32_t color_bits = 8;     ///< of red, green, blue (as sRGB) and alpha, 2..16
  float uv_step = 0x1p-14f;    ///< texture coordinates become multiples of this power of two
  /// Size of a page, the unit of reading: a multiple of 4096, up to 1 GiB. A larger group has a
  /// page of its own. 0: 40 KiB, 64 KiB where the file takes over 4 GB, 256 KiB over 16 GB.
  uint32_t page_bytes = 0;

  static AssetConfig exact() { return {0, 0, 0, 0}; }
};

/// All that an asset may hold.
struct AssetContents {
  std::vector<const lod::Dag*> meshes;
  /// Empty: each mesh once, untransformed.
  std::vector<Instance> instances;
  /// More instances than this become a tree: see instance_tree.hpp.
  uint32_t most_listed_instances = 1u << 16;
  std::string metadata = "{}";   ///< a JSON object, read as AssetInfo::metadata
  std::string materials = "{}";  ///< a JSON object: see docs/format.md, section MTRL
  /// What is added to each mesh's material numbers, so that each may have its own of `materials`;
  /// empty: nothing.
  std::vector<uint32_t> first_materials;
  /// Files that `materials` refers to: images.
  std::vector<std::vector<std::byte>> files;
  /// Added to every point of the asset, so that coordinates can be small floats.
  Vec3d origin{};
  /// A JSON object about the scene that the meshes are from, or "": see docs/format.md, section
  /// SCEN.
  std::string scene;
};

/// Writes beside `path` and renames, so that a file of that name is always whole. Returns the bytes
/// written. Throws kIo, kCancelled, and kInvalidArgument for a DAG that cannot be stored (a range
/// or index out of its table, clusters not in one group each, nodes that are no tree), an instance
/// of no mesh, or a configuration out of range. A DAG that is only wrong (an error too low, a
/// triangle missing) is stored unchanged; verify_asset reports it.
UMBEL_API uint64_t write_asset(const std::filesystem::path& path, const AssetContents& contents,
                               const BuildOptions& options = {}, const AssetConfig& config = {});
/// The same for one mesh.
UMBEL_API uint64_t write_asset(const std::filesystem::path& path, const lod::Dag& dag,
                               const std::string& metadata = "{}", const BuildOptions& options = {},
                               const AssetConfig& config = {});

/// Where an asset's bytes come from: a file, memory, a server. `read` is called from many threads
/// at once, and may throw anything.
class UMBEL_API ByteSource {
 public:
  virtual ~ByteSource() = default;
  virtual uint64_t size() const = 0;
  /// Fills `out` from `offset` on, all of it within size().
  virtual void read(uint64_t offset, std::span<std::byte> out) const = 0;
};

/// Sources of files and of memory; throw kIo. A file that shrinks while it is open is an error if
/// it is read by position, and ends the process if it is mapped.
UMBEL_API std::shared_ptr<const ByteSource> open_file(const std::filesystem::path& path);
UMBEL_API std::shared_ptr<const ByteSource> map_file(const std::filesystem::path& path);
UMBEL_API std::shared_ptr<const ByteSource> from_memory(std::vector<std::byte> bytes);

/// An open asset. Opening reads only the file header, and of a large file not even its table of
/// pages, which is then read in slices; tables are read when first asked for, and pages when
/// needed. Safe to use from many threads.
class UMBEL_API Asset {
 public:
  /// Reads and checks the file header. Throws kIo, kCorrupt, kUnsupported (a newer version).
  explicit Asset(const std::filesystem::path& path);
  /// `name` is what errors of a damaged file begin with; for a path it is the path.
  explicit Asset(std::shared_ptr<const ByteSource> source, std::string name = {});
  Asset(Asset&&) noexcept;
  Asset& operator=(Asset&&) noexcept;
  ~Asset();

  const AssetInfo& info() const;
  const std::vector<AssetMesh>& meshes() const;
  /// The instances; where there is a tree of them, the stand-ins of its root.
  const std::vector<Instance>& instances() const;
  /// The tree of instances, breadth first: no nodes where all instances are listed. The first call
  /// reads them, 64 bytes each. Throws kCorrupt if they make no tree.
  const std::vector<InstanceNode>& instance_nodes() const;
  bool has_instance_tree() const;
  /// The placements of a node's page, read. Throws kCorrupt if its checksum does not hold.
  std::vector<Instance> placements(uint32_t node) const;
  /// Bytes of a node's page.
  uint32_t placement_bytes(uint32_t node) const;
  /// One a mesh; none without a tree.
  const std::vector<InstancedMesh>& instanced_meshes() const;
  /// JSON; docs/format.md, section MTRL.
  const std::string& materials() const;
  /// JSON, or ""; docs/format.md, section SCEN.
  const std::string& scene() const;
  /// A file that `materials` refers to. Throws kCorrupt if its checksum does not hold.
  std::vector<std::byte> file(uint32_t index) const;
  uint32_t files() const;

  /// The groups of a mesh that no cluster was made from: a traversal from coarse to fine starts
  /// here.
  std::span<const GroupRef> roots(uint32_t mesh = 0) const;
  /// The groups of each level of a mesh, finest first, as the file says.
  std::span<const Range> levels(uint32_t mesh = 0) const;
  /// Size of a page. Throws kInvalidArgument for a page out of range, as the following do, and
  /// kCorrupt where the table of pages is damaged.
  uint32_t page_bytes(uint32_t page) const;
  /// Reads a page. Throws kCorrupt if its checksum does not hold or its contents are impossible.
  AssetPage read_page(uint32_t page) const;
  /// The same from bytes that the caller has read; also throws kCorrupt for a wrong number of
  /// bytes.
  AssetPage page_of(uint32_t page, std::vector<std::byte> bytes) const;
  /// The clusters of groups[index] of a page of this asset.
  std::vector<lod::ClusterGeometry> decode(const AssetPage& page, size_t index) const;
  /// Whether the page's checksum holds.
  bool page_is_whole(uint32_t page) const;
  /// Whether the whole file header's checksum holds, which opening checks of small files only.
  bool header_is_whole() const;
  /// Reads a mesh's hierarchy. Throws kCorrupt if a checksum does not hold.
  std::vector<lod::Node> nodes(uint32_t mesh = 0) const;

  /// What a page says of a group, from a table of coarse groups that large files have; null for
  /// other groups. The first call reads the table. Throws kCorrupt if its checksum does not hold.
  const Refinement* refinement(uint32_t group, uint32_t mesh = 0) const;

  /// Finds the cut of a view, without what lies outside the planes, and passes on its groups by
  /// pages, coarse ones first. It descends from the roots by references, so it reads the pages of
  /// groups that must be refined and no others, each once, and keeps one at a time; of groups that
  /// `refinement` knows, only those with clusters in the cut. The clusters are those of
  /// lod::select. Throws what the visitor throws, and kCorrupt where references do not
  /// lead where they say.
  WalkReport walk(const lod::View& view, const CutVisitor& visit, uint32_t mesh = 0,
                  std::span<const Plane> planes = {}) const;

  /// All that selection needs. The first call reads every page, and takes some 45 bytes a cluster:
  /// see `walk` for large assets. Throws kCorrupt if pages do not fit together.
  const lod::Tables& tables(uint32_t mesh = 0) const;
  /// One cluster, by its number in the mesh's tables. Caches its group for the next call.
  lod::ClusterGeometry geometry(uint32_t cluster, uint32_t mesh = 0) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// The finest view, by error or by camera, that is not finer than `view` and whose cuts have no
/// more triangles in all instances together (none: each mesh once); the coarsest where none has so
/// few. As lod::view_for_budget, but descending from the roots, the largest error first, so that it
/// reads no more pages than the cut needs, each once.
UMBEL_API lod::View view_for_triangles(const Asset& asset, const lod::View& view,
                                       uint64_t max_triangles,
                                       std::span<const Instance> instances = {});

/// Reads every page, one at a time, and counts: one summary a mesh.
UMBEL_API std::vector<MeshSummary> summarize(const Asset& asset, const BuildOptions& options = {});

/// A cluster of a cut, and where it is: AssetPage::groups[group], of that clusters[cluster].
struct CutCluster {
  uint32_t id;  ///< its number in the mesh's tables
  uint32_t page, group, cluster;
  uint32_t material;
  uint32_t triangles;
  auto operator<=>(const CutCluster&) const = default;
};
/// The clusters that a walk finds, by rising id; `report` may be null.
UMBEL_API std::vector<CutCluster> clusters_of_cut(const Asset& asset, const lod::View& view,
                                                  uint32_t mesh = 0,
                                                  std::span<const Plane> planes = {},
                                                  WalkReport* report = nullptr);
/// As lod::mesh_of_cut, of clusters by rising id: equal vertices of different clusters become one.
UMBEL_API Mesh mesh_of_clusters(const Asset& asset, std::span<const CutCluster> cut);

/// Checks every checksum, then every mesh by lod::verify. A file that cannot be opened as an asset
/// gives a report with checksum_errors, not an exception, unless it does not exist (kIo).
UMBEL_API lod::VerifyReport verify_asset(const std::filesystem::path& path, uint32_t cuts = 64,
                                         uint32_t seed = 1, const BuildOptions& options = {});
UMBEL_API lod::VerifyReport verify_asset(const Asset& asset, uint32_t cuts = 64, uint32_t seed = 1,
                                         const BuildOptions& options = {});

/// The same in about so many bytes, however large the asset is: pages are read in order, several
/// times. All but the random cuts is checked as whole as verify_asset checks it; of each cut it
/// looks at one window. Throws kInvalidArgument, and says what would do, for less than the tables
/// of groups take: some 200 bytes a group, a group having some 3500 triangles.
UMBEL_API lod::VerifyReport verify_asset_within(uint64_t memory_bytes, const Asset& asset,
                                                uint32_t cuts = 64, uint32_t seed = 1,
                                                const BuildOptions& options = {});
UMBEL_API lod::VerifyReport verify_asset_within(uint64_t memory_bytes,
                                                const std::filesystem::path& path,
                                                uint32_t cuts = 64, uint32_t seed = 1,
                                                const BuildOptions& options = {});

}  // namespace umbel
