// The groups that a group was made from are in its page or a later one, so pages are planned
// before the first is written. The file header, which has every checksum, is written last.
#include "asset/file/write_encoded.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <utility>

#include "asset/file/coarse_groups.hpp"
#include "asset/file/format.hpp"
#include "asset/file/group_chunk.hpp"
#include "asset/file/page.hpp"
#include "asset/instances/build_tree.hpp"
#include "asset/instances/tree_file.hpp"
#include "base/hash.hpp"
#include "base/math.hpp"
#include "base/refuse.hpp"

namespace umbel::asset {
namespace {

constexpr uint64_t kMaxPageBytes = 1u << 30, kPageSizeStep = 4096;
// Numbers of materials may be floats; whole ones are exact up to here.
constexpr uint32_t kMostFirstMaterial = 1u << 24;
constexpr uint32_t kPagesAReport = 64;

/// Appends to one of the header's tables what is one mesh's, and returns where it is.
template <typename Element>
Range append(std::vector<Element>& table, const std::vector<Element>& more) {
  const Range range{static_cast<uint32_t>(table.size()), static_cast<uint32_t>(more.size())};
  table.insert(table.end(), more.begin(), more.end());
  return range;
}

class Writer {
 public:
  Writer(const AssetContents& contents, std::vector<EncodedMesh> meshes, uint32_t page_bytes)
      : contents_(contents) {
    for (EncodedMesh& mesh : meshes) add_mesh(std::move(mesh));
    plan_ = plan_pages(groups_, page_bytes);
    header_.info.page_bytes = plan_.page_bytes;
    for (size_t m = 0; m < groups_.size(); ++m) add_roots(m);
    header_.info.metadata = contents_.metadata;
    // Without the sign of zero, which the sum does not keep.
    header_.info.origin = {contents_.origin.x + 0.0, contents_.origin.y + 0.0,
                           contents_.origin.z + 0.0};
    header_.scene = contents_.scene;
    header_.materials = contents_.materials;
    if (contents_.instances.size() > contents_.most_listed_instances)
      build_instances();
    else
      header_.instances = contents_.instances;
    header_.files.resize(contents_.files.size());
  }

  uint64_t write(OutputFile& file, const ChunkReader& read_chunk, Progress& progress,
                 double begun) {
    lay_out_header();
    uint64_t at = header_bytes(header_);
    for (uint32_t p = 0; p < plan_.pages.size(); ++p) {
      if (p % kPagesAReport == 0)
        progress.report(begun + (1 - begun) * p / static_cast<double>(plan_.pages.size()),
                        "writing");
      const std::vector<std::byte> page = make_page(p, read_chunk);
      file.write(at, page);
      header_.pages[p] = {at, static_cast<uint32_t>(page.size()), plan_.pages[p].count,
                          xxh64(page.data(), page.size())};
      at += page.size();
    }
    header_.info.file_bytes = at;
    write_tail(file);
    file.write(0, encode_header(header_));
    return header_.info.file_bytes;
  }

 private:
  void add_mesh(EncodedMesh&& mesh) {
    MeshEntry entry;
    entry.mesh = mesh.mesh;
    entry.attributes = append(header_.attributes, mesh.format.attributes);
    entry.levels = append(header_.levels, mesh.levels);
    entry.nodes = nodes_.empty() ? Range{0, static_cast<uint32_t>(mesh.nodes.size())}
                                 : append(nodes_, mesh.nodes);
    if (nodes_.empty()) nodes_ = std::move(mesh.nodes);
    header_.meshes.push_back(entry);
    header_.info.max_triangles = std::max(header_.info.max_triangles, mesh.max_triangles);
    header_.info.max_vertices = std::max(header_.info.max_vertices, mesh.max_vertices);
    groups_.push_back(std::move(mesh.groups));
  }

  /// Of instances too many to be listed, whose tree lists only the stand-ins of its root.
  void build_instances() {
    for (size_t m = 0; m < groups_.size(); ++m) {
      // Errors never fall towards the roots, whose own are infinite.
      float error = 0;
      for (const GroupEntry& entry : groups_[m])
        if (std::isfinite(entry.group.error)) error = std::max(error, entry.group.error);
      instanced_.push_back({header_.meshes[m].mesh.bounds, error});
      header_.coarsest_errors.push_back(error);
    }
    instances_ = std::make_unique<InstanceTree>(contents_.instances, instanced_);
    header_.instances = instances_->top();
    // As many sections as there will be.
    header_.instance_nodes.count = header_.instance_pages.count = 1;
  }

  GroupRef reference_to(const GroupName& name) const {
    const GroupEntry& entry = groups_[name.mesh][name.group];
    return {name.group, entry.page, entry.parents, entry.group.sphere, entry.group.error};
  }

  void add_roots(size_t mesh) {
    std::vector<GroupRef> roots;
    for (uint32_t g = 0; g < groups_[mesh].size(); ++g)
      if (groups_[mesh][g].parents == 0)
        roots.push_back(reference_to({static_cast<uint32_t>(mesh), g}));
    header_.meshes[mesh].roots = append(header_.roots, roots);
  }

  /// As many entries as there will be, for the size of the file header.
  void lay_out_header() {
    header_.pages.resize(plan_.pages.size());
    header_.has_page_slices = wants_slices(plan_.pages.size());
    if (wants_slices(nodes_.size()))
      header_.nodes.slices.resize((nodes_.size() + kSliceEntries - 1) / kSliceEntries);
    if (plan_.pages.size() >= kLeastCoarsePages) lay_out_coarse();
  }

  void lay_out_coarse() {
    uint64_t groups = 0;
    for (uint32_t m = 0; m < groups_.size(); ++m) {
      const uint32_t first = first_coarse(header_, header_.meshes[m]);
      formats_.push_back(format_of(header_, header_.meshes[m]));
      coarse_.push_back({first, std::vector<Refinement>(groups_[m].size() - first)});
      groups += coarse_.back().groups.size();
      ++header_.coarse.count;
      for (size_t g = first; g < groups_[m].size(); ++g)
        header_.coarse.count += 1 + groups_[m][g].references;
    }
    if (groups > 0) return;
    coarse_.clear();
    header_.coarse.count = 0;
  }

  std::vector<std::byte> make_page(uint32_t page, const ChunkReader& read_chunk) {
    std::vector<EncodedGroup> groups;
    for (uint32_t i = 0; i < plan_.pages[page].count; ++i) {
      const GroupName name = plan_.order[plan_.pages[page].offset + i];
      const GroupEntry& entry = groups_[name.mesh][name.group];
      std::vector<std::byte> chunk = read_chunk(name);
      for (uint32_t r = 0; r < entry.references; ++r)
        write_reference(chunk, r, reference_to({name.mesh, referred_group(chunk, r)}));
      keep_coarse(name, chunk);
      groups.push_back(
          {name.mesh, name.group, entry.group, entry.parents, entry.references, std::move(chunk)});
    }
    return encode_page(page, groups);
  }

  /// For the table of coarse groups, if there will be one.
  void keep_coarse(const GroupName& name, std::span<const std::byte> chunk) {
    if (coarse_.empty()) return;
    const MeshEntry& mesh = header_.meshes[name.mesh];
    auto& [first, groups] = coarse_[name.mesh];
    if (name.group < first) return;
    const GroupEntry& entry = groups_[name.mesh][name.group];
    const ChunkTables tables =
        decode_tables(formats_[name.mesh], mesh.mesh.bounds, entry.group.clusters.count,
                      entry.references, chunk, kVersionMajor);
    groups[name.group - first] = refinement_of(tables.clusters, tables.children);
  }

  void write_coarse(OutputFile& file) {
    std::vector<std::byte> table;
    for (uint32_t m = 0; m < coarse_.size(); ++m) {
      const auto& [first, groups] = coarse_[m];
      append_first(first, table);
      for (uint32_t k = 0; k < groups.size(); ++k)
        append_coarse(reference_to({m, first + k}), groups[k], table);
    }
    uint64_t& at = header_.info.file_bytes;
    file.write(at, table);
    header_.coarse = {
        at, table.size() / kCoarseBytes, kCoarseBytes, xxh64(table.data(), table.size()), {}};
    at += table.size();
  }

  /// What lies behind the pages.
  void write_tail(OutputFile& file) {
    uint64_t& at = header_.info.file_bytes;
    const std::vector<std::byte> nodes = encode_nodes(nodes_);
    file.write(at, nodes);
    header_.nodes = {at, nodes_.size(), kNodeBytes, xxh64(nodes.data(), nodes.size()), {}};
    if (wants_slices(nodes_.size())) header_.nodes.slices = slice_checksums(nodes, kNodeBytes);
    at += nodes.size();
    if (header_.coarse.count > 0) write_coarse(file);
    for (size_t i = 0; i < contents_.files.size(); ++i) {
      const std::vector<std::byte>& bytes = contents_.files[i];
      file.write(at, bytes);
      header_.files[i] = {at, bytes.size(), xxh64(bytes.data(), bytes.size())};
      at += bytes.size();
    }
    if (instances_) write_instances(file);
  }

  /// Pages of placements in their nodes' order, coarse ones first, then the nodes.
  void write_instances(OutputFile& file) {
    uint64_t& at = header_.info.file_bytes;
    at = aligned(at, 8);
    StoredInstanceTree tree{instances_->nodes(), {}};
    const uint64_t first = at;
    for (uint32_t n = 0; n < tree.nodes.size(); ++n) {
      const std::vector<std::byte> page = encode_placements(n, instances_->placements(n));
      file.write(at, page);
      tree.pages.push_back(
          {at - first, static_cast<uint32_t>(page.size()), xxh64(page.data(), page.size())});
      at += page.size();
    }
    // The nodes have the pages' checksums.
    header_.instance_pages = {first, at - first, 1, 0, {}};
    const std::vector<std::byte> nodes = encode_instance_nodes(tree);
    file.write(at, nodes);
    header_.instance_nodes = {
        at, tree.nodes.size(), kInstanceNodeBytes, xxh64(nodes.data(), nodes.size()), {}};
    at += nodes.size();
  }

  const AssetContents& contents_;
  FileHeader header_;
  std::vector<lod::Node> nodes_;
  std::vector<std::vector<GroupEntry>> groups_;  // by mesh
  PagePlan plan_;
  // Of the table of coarse groups, by mesh; none if there will be none.
  std::vector<VertexFormat> formats_;
  std::vector<CoarseGroups> coarse_;
  std::vector<InstancedMesh> instanced_;
  std::unique_ptr<InstanceTree> instances_;  // none if all are listed
};

}  // namespace

void check_contents(const AssetContents& contents, const AssetConfig& config, size_t meshes) {
  if (config.page_bytes % kPageSizeStep != 0 || config.page_bytes > kMaxPageBytes)
    refuse("page_bytes is " + std::to_string(config.page_bytes) +
           ", but must be a multiple of 4096 up to 1 GiB, or 0");
  if (!contents.first_materials.empty() && contents.first_materials.size() != meshes)
    refuse("first_materials has " + std::to_string(contents.first_materials.size()) +
           " elements, but there are " + std::to_string(meshes) + " meshes");
  for (const uint32_t first : contents.first_materials)
    if (first > kMostFirstMaterial)
      refuse("first_materials has " + std::to_string(first) + ", at most " +
             std::to_string(kMostFirstMaterial) + " is possible");
  if (!is_finite(contents.origin)) refuse("the asset's origin is not finite");
  for (size_t i = 0; i < contents.instances.size(); ++i) {
    const Instance& instance = contents.instances[i];
    const auto& t = instance.transform.rows;
    if (instance.mesh >= meshes ||
        !std::all_of(t.begin(), t.end(), [](float f) { return std::isfinite(f); }))
      refuse("instance " + std::to_string(i) + " is of mesh " + std::to_string(instance.mesh) +
             " of " + std::to_string(meshes) + ", or its transform is not finite");
  }
}

uint32_t first_material(const AssetContents& contents, size_t mesh) {
  return contents.first_materials.empty() ? 0 : contents.first_materials[mesh];
}

uint64_t write_encoded(OutputFile& file, const AssetContents& contents,
                       std::vector<EncodedMesh> meshes, uint32_t page_bytes,
                       const ChunkReader& read_chunk, Progress& progress, double begun) {
  const uint64_t bytes =
      Writer(contents, std::move(meshes), page_bytes).write(file, read_chunk, progress, begun);
  progress.report(1, "writing");
  return bytes;
}

}  // namespace umbel::asset
