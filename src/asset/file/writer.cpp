// Writes an asset. Groups are encoded in parallel, coarsest first, and packed into pages. The
// groups that a group was made from are in its page or a later one, so references are filled in
// once all pages are known. The file header, which has every checksum, is written last.
#include <algorithm>
#include <cmath>
#include <numeric>

#include "asset/codec/choose_format.hpp"
#include "asset/file/format.hpp"
#include "asset/file/group_chunk.hpp"
#include "asset/file/page.hpp"
#include "base/bytes.hpp"
#include "base/file.hpp"
#include "base/hash.hpp"
#include "base/math.hpp"
#include "base/parallel.hpp"
#include "base/progress.hpp"
#include "lod/verify/table_structure.hpp"

namespace umbel {
namespace asset {
namespace {

constexpr size_t kBatch = 256;  // groups
/// How many groups that do not fit a page any more are passed by in search of one that does.
constexpr size_t kReach = 12;
constexpr uint64_t kMaxPageBytes = 1u << 30;
// Numbers of materials may be floats; whole ones are exact up to here.
constexpr uint32_t kMostFirstMaterial = 1u << 24;

[[noreturn]] void refuse(const std::string& sentence) {
  throw Error(ErrorCode::kInvalidArgument, sentence);
}

template <typename Vector>
void check_stream(const char* name, const std::vector<Vector>& stream, size_t vertices) {
  if (!stream.empty() && stream.size() != vertices)
    refuse(std::string("the DAG's ") + name + " has " + std::to_string(stream.size()) +
           " elements, but there are " + std::to_string(vertices) + " vertices");
}

void check_offsets(const char* name, const std::vector<uint32_t>& offsets, size_t clusters,
                   size_t size) {
  if (offsets.size() != clusters + 1 || offsets.front() != 0 || offsets.back() != size ||
      !std::is_sorted(offsets.begin(), offsets.end()))
    refuse(std::string("the DAG's ") + name + " must rise from 0 to " + std::to_string(size) +
           " in " + std::to_string(clusters + 1) + " elements");
}

void check_cluster(const lod::Dag& dag, uint32_t cluster) {
  const uint32_t begin = dag.vertex_offsets[cluster], end = dag.vertex_offsets[cluster + 1];
  const auto refuse_cluster = [&](const std::string& what) {
    refuse("cluster " + std::to_string(cluster) + " has " + what);
  };
  const lod::Cluster& entry = dag.tables.clusters[cluster];
  const Range& range = dag.tables.groups[entry.group].clusters;
  if (cluster - range.offset >= range.count)
    refuse_cluster("the group " + std::to_string(entry.group) +
                   ", in whose range of clusters it is not");
  const uint32_t triangles = dag.triangle_offsets[cluster + 1] - dag.triangle_offsets[cluster];
  if (end - begin < 1 || end - begin > kMaxLocal || triangles < 1 || triangles > kMaxLocal)
    refuse_cluster(std::to_string(end - begin) + " vertices and " + std::to_string(triangles) +
                   " triangles, but must have 1 to 256 of each");
  if (entry.vertex_count != end - begin || entry.triangle_count != triangles)
    refuse_cluster("the counts " + std::to_string(entry.vertex_count) + " and " +
                   std::to_string(entry.triangle_count) + ", but " + std::to_string(end - begin) +
                   " vertices and " + std::to_string(triangles) + " triangles");
  for (uint32_t i = begin; i < end; ++i)
    if (dag.cluster_vertices[i] >= dag.vertices.positions.size())
      refuse_cluster("the vertex " + std::to_string(dag.cluster_vertices[i]) + " of " +
                     std::to_string(dag.vertices.positions.size()));
  const size_t last = size_t{3} * dag.triangle_offsets[cluster + 1];
  for (size_t i = size_t{3} * dag.triangle_offsets[cluster]; i < last; ++i)
    if (dag.cluster_triangles[i] >= end - begin)
      refuse_cluster("a triangle with the local vertex " +
                     std::to_string(dag.cluster_triangles[i]) + " of " +
                     std::to_string(end - begin));
}

/// Refuses what cannot be stored or read back; what is merely wrong is lod::verify's to find.
void check_dag(const lod::Dag& dag) {
  if (const std::string fault = lod::structure_fault(dag.tables); !fault.empty()) refuse(fault);
  const size_t clusters = dag.tables.clusters.size(), vertices = dag.vertices.positions.size();
  check_stream("normals", dag.vertices.normals, vertices);
  check_stream("tangents", dag.vertices.tangents, vertices);
  check_stream("uvs", dag.vertices.uvs, vertices);
  check_stream("colors", dag.vertices.colors, vertices);
  const size_t width = extra_width(dag.vertices.extras);
  if (width > kMostExtraValues || dag.vertices.extra_values.size() != width * vertices)
    refuse("the DAG's extra_values has " + std::to_string(dag.vertices.extra_values.size()) +
           " elements for " + std::to_string(vertices) + " vertices of " + std::to_string(width));
  if (clusters == 0) return;
  if (dag.cluster_triangles.size() % 3 != 0)
    refuse("the DAG's cluster_triangles has " + std::to_string(dag.cluster_triangles.size()) +
           " elements, not three a triangle");
  check_offsets("vertex_offsets", dag.vertex_offsets, clusters, dag.cluster_vertices.size());
  check_offsets("triangle_offsets", dag.triangle_offsets, clusters,
                dag.cluster_triangles.size() / 3);
  for (uint32_t c = 0; c < clusters; ++c) check_cluster(dag, c);
}

void check_contents(const AssetContents& contents, const AssetConfig& config) {
  if (config.page_bytes % kPageAlignment != 0 || config.page_bytes > kMaxPageBytes)
    refuse("page_bytes is " + std::to_string(config.page_bytes) +
           ", but must be a multiple of 4096 up to 1 GiB, or 0");
  for (const lod::Dag* dag : contents.meshes) {
    if (dag == nullptr) refuse("one of the asset's meshes is null");
    check_dag(*dag);
  }
  if (!contents.first_materials.empty() &&
      contents.first_materials.size() != contents.meshes.size())
    refuse("first_materials has " + std::to_string(contents.first_materials.size()) +
           " elements, but there are " + std::to_string(contents.meshes.size()) + " meshes");
  for (const uint32_t first : contents.first_materials)
    if (first > kMostFirstMaterial)
      refuse("first_materials has " + std::to_string(first) + ", at most " +
             std::to_string(kMostFirstMaterial) + " is possible");
  if (!is_finite(contents.origin)) refuse("the asset's origin is not finite");
  for (size_t i = 0; i < contents.instances.size(); ++i) {
    const Instance& instance = contents.instances[i];
    const auto& t = instance.transform.rows;
    if (instance.mesh >= contents.meshes.size() ||
        !std::all_of(t.begin(), t.end(), [](float f) { return std::isfinite(f); }))
      refuse("instance " + std::to_string(i) + " is of mesh " + std::to_string(instance.mesh) +
             " of " + std::to_string(contents.meshes.size()) + ", or its transform is not finite");
  }
}

/// Appends to one of the header's tables what is one mesh's, and returns where it is.
template <typename Element>
Range append(std::vector<Element>& table, std::span<const Element> more) {
  const Range range{static_cast<uint32_t>(table.size()), static_cast<uint32_t>(more.size())};
  table.insert(table.end(), more.begin(), more.end());
  return range;
}

class Writer {
 public:
  Writer(const AssetContents& contents, const AssetConfig& config, Progress& progress)
      : contents_(contents), config_(config), progress_(progress) {}

  uint64_t write(OutputFile& file) {
    for (const lod::Dag* dag : contents_.meshes) add_mesh(*dag);
    order_groups();
    encode_groups();
    choose_page_bytes();
    fill_pages();
    refer_to_pages();
    for (size_t m = 0; m < contents_.meshes.size(); ++m) add_roots(m);
    header_.info.metadata = contents_.metadata;
    // Without the sign of zero, which the sum does not keep.
    header_.info.origin = {contents_.origin.x + 0.0, contents_.origin.y + 0.0,
                           contents_.origin.z + 0.0};
    header_.scene = contents_.scene;
    header_.materials = contents_.materials;
    header_.instances = contents_.instances;
    header_.files.resize(contents_.files.size());
    write_pages(file);
    write_tail(file);
    file.write(0, encode_header(header_));
    return header_.info.file_bytes;
  }

 private:
  /// Where a group is, and what its page must say of it.
  struct GroupLocation {
    std::vector<uint32_t> children;
    uint32_t parents = 0, page = 0;
  };

  void add_mesh(const lod::Dag& dag) {
    MeshEntry entry;
    for (const lod::Cluster& cluster : dag.tables.clusters) extend(entry.mesh.bounds, cluster.box);
    entry.mesh.source_triangles = dag.report.input_triangles;
    entry.mesh.source_vertices = dag.report.input_vertices;
    entry.mesh.source_digest = dag.source_digest;
    entry.mesh.groups = static_cast<uint32_t>(dag.tables.groups.size());
    entry.mesh.clusters = static_cast<uint32_t>(dag.tables.clusters.size());
    formats_.push_back(choose_format(dag, config_));
    entry.attributes =
        append<AttributeFormat>(header_.attributes, std::span(formats_.back().attributes));
    entry.levels = append<Range>(header_.levels, dag.tables.levels);
    entry.nodes = append<lod::Node>(nodes_, dag.tables.nodes);
    header_.meshes.push_back(entry);
    header_.info.max_triangles = std::max(header_.info.max_triangles, dag.config.max_triangles);
    header_.info.max_vertices = std::max(header_.info.max_vertices, dag.config.max_vertices);

    std::vector<GroupLocation>& locations = locations_.emplace_back(entry.mesh.groups);
    for (uint32_t g = 0; g < entry.mesh.groups; ++g) {
      locations[g].children = children_of(group_of(dag, g).clusters);
      if (locations[g].children.size() > kMaxReferences)
        refuse("group " + std::to_string(g) + " was made from " +
               std::to_string(locations[g].children.size()) + " groups, but at most 65535 can be");
      for (const uint32_t child : locations[g].children) ++locations[child].parents;
    }
  }

  /// Coarsest first in every mesh, meshes side by side: any prefix of the pages shows all of them.
  void order_groups() {
    std::vector<uint32_t> depth;  // below the coarsest level of its mesh
    for (uint32_t m = 0; m < contents_.meshes.size(); ++m) {
      const auto& groups = contents_.meshes[m]->tables.groups;
      uint32_t coarsest = 0;
      for (const lod::Group& group : groups) coarsest = std::max(coarsest, group.level);
      for (uint32_t g = 0; g < groups.size(); ++g) {
        depth.push_back(coarsest - groups[g].level);
        encoded_.push_back({m,
                            g,
                            groups[g],
                            locations_[m][g].parents,
                            static_cast<uint32_t>(locations_[m][g].children.size()),
                            {}});
      }
    }
    std::vector<uint32_t> order(depth.size());
    std::iota(order.begin(), order.end(), 0u);
    std::stable_sort(order.begin(), order.end(),
                     [&](uint32_t a, uint32_t b) { return depth[a] < depth[b]; });
    std::vector<EncodedGroup> ordered;
    ordered.reserve(order.size());
    for (const uint32_t i : order) {
      ordered.push_back(std::move(encoded_[i]));
      depths_.push_back(depth[i]);
    }
    encoded_ = std::move(ordered);
  }

  uint32_t first_material(uint32_t mesh) const {
    return contents_.first_materials.empty() ? 0 : contents_.first_materials[mesh];
  }

  void encode_groups() {
    for (size_t begin = 0; begin < encoded_.size(); begin += kBatch) {
      progress_.report(static_cast<double>(begin) / static_cast<double>(encoded_.size()),
                       "writing");
      parallel_for(std::min(kBatch, encoded_.size() - begin), 1, [&](size_t i) {
        EncodedGroup& group = encoded_[begin + i];
        const ChunkFormat format{formats_[group.mesh], header_.meshes[group.mesh].mesh.bounds,
                                 first_material(group.mesh)};
        group.chunk = encode_chunk(format, group_of(*contents_.meshes[group.mesh], group.id),
                                   locations_[group.mesh][group.id].children);
      });
    }
  }

  void choose_page_bytes() {
    header_.info.page_bytes = config_.page_bytes;
    if (config_.page_bytes > 0) return;
    uint64_t bytes = 0;
    for (const EncodedGroup& group : encoded_) bytes += kGroupRecordBytes + group.chunk.size();
    header_.info.page_bytes = page_bytes_for(bytes);
  }

  /// Fills pages one after the other, each with the next group and with what fits of those soon
  /// after it, as long as they are as far below the coarsest level: parents stay in front.
  void fill_pages() {
    std::vector<bool> is_in_page(encoded_.size());
    std::vector<EncodedGroup> ordered;
    ordered.reserve(encoded_.size());
    for (size_t next = 0; next < encoded_.size(); ++next) {
      if (is_in_page[next]) continue;
      pages_.push_back({static_cast<uint32_t>(ordered.size()), 0});
      uint64_t bytes = kPageHeaderBytes;
      size_t passed = 0;
      for (size_t i = next; i < encoded_.size() && passed <= kReach; ++i) {
        if (is_in_page[i]) continue;
        if (passed > 0 && depths_[i] != depths_[next]) break;
        const uint64_t more = kGroupRecordBytes + encoded_[i].chunk.size();
        if (i > next && bytes + more > header_.info.page_bytes) {
          ++passed;
          continue;
        }
        bytes += more;
        is_in_page[i] = true;
        ++pages_.back().count;
        locations_[encoded_[i].mesh][encoded_[i].id].page =
            static_cast<uint32_t>(pages_.size() - 1);
        ordered.push_back(std::move(encoded_[i]));
      }
    }
    encoded_ = std::move(ordered);
  }

  GroupRef reference_to(uint32_t mesh, uint32_t group) const {
    const lod::Group& g = contents_.meshes[mesh]->tables.groups[group];
    const GroupLocation& location = locations_[mesh][group];
    return {group, location.page, location.parents, g.sphere, g.error};
  }

  void refer_to_pages() {
    for (EncodedGroup& group : encoded_) {
      const std::vector<uint32_t>& children = locations_[group.mesh][group.id].children;
      for (size_t i = 0; i < children.size(); ++i)
        write_reference(group.chunk, i, reference_to(group.mesh, children[i]));
    }
  }

  void add_roots(size_t mesh) {
    std::vector<GroupRef> roots;
    for (uint32_t g = 0; g < locations_[mesh].size(); ++g)
      if (locations_[mesh][g].parents == 0)
        roots.push_back(reference_to(static_cast<uint32_t>(mesh), g));
    header_.meshes[mesh].roots = append<GroupRef>(header_.roots, roots);
  }

  void write_pages(OutputFile& file) {
    header_.pages.resize(pages_.size());
    header_.has_page_slices = wants_slices(pages_.size());
    // As many as there will be, for the size of the file header.
    if (wants_slices(nodes_.size()))
      header_.nodes.slices.resize((nodes_.size() + kSliceEntries - 1) / kSliceEntries);
    uint64_t at = header_bytes(header_);
    for (uint32_t p = 0; p < pages_.size(); ++p) {
      const auto groups = std::span(encoded_).subspan(pages_[p].offset, pages_[p].count);
      const std::vector<std::byte> page = encode_page(p, groups);
      file.write(at, page);
      header_.pages[p] = {at, static_cast<uint32_t>(page.size()), pages_[p].count,
                          xxh64(page.data(), page.size())};
      at += page.size();
    }
    header_.info.file_bytes = at;
  }

  /// What lies behind the pages.
  void write_tail(OutputFile& file) {
    uint64_t& at = header_.info.file_bytes;
    const std::vector<std::byte> nodes = encode_nodes(nodes_);
    file.write(at, nodes);
    header_.nodes = {at, nodes_.size(), kNodeBytes, xxh64(nodes.data(), nodes.size()), {}};
    if (wants_slices(nodes_.size())) header_.nodes.slices = slice_checksums(nodes, kNodeBytes);
    at += nodes.size();
    for (size_t i = 0; i < contents_.files.size(); ++i) {
      const std::vector<std::byte>& bytes = contents_.files[i];
      file.write(at, bytes);
      header_.files[i] = {at, bytes.size(), xxh64(bytes.data(), bytes.size())};
      at += bytes.size();
    }
  }

  const AssetContents& contents_;
  const AssetConfig& config_;
  Progress& progress_;
  FileHeader header_;
  std::vector<VertexFormat> formats_;
  std::vector<lod::Node> nodes_;
  std::vector<std::vector<GroupLocation>> locations_;  // by mesh and group
  std::vector<EncodedGroup> encoded_;                  // in file order
  std::vector<uint32_t> depths_;                       // of encoded_, until pages are filled
  std::vector<Range> pages_;                           // of encoded_
};

}  // namespace
}  // namespace asset

uint64_t write_asset(const std::filesystem::path& path, const AssetContents& contents,
                     const BuildOptions& options, const AssetConfig& config) {
  using namespace asset;
  Progress progress(options);
  check_contents(contents, config);
  OutputFile file(path);
  uint64_t bytes = 0;
  with_threads(options.threads, [&] { bytes = Writer(contents, config, progress).write(file); });
  progress.report(1, "writing");
  file.commit();
  return bytes;
}

uint64_t write_asset(const std::filesystem::path& path, const lod::Dag& dag,
                     const std::string& metadata, const BuildOptions& options,
                     const AssetConfig& config) {
  AssetContents contents;
  contents.meshes = {&dag};
  contents.metadata = metadata;
  return write_asset(path, contents, options, config);
}

}  // namespace umbel
