// An open asset. Opening reads and checks the file header; everything else is read when asked for,
// and checked before use.
#include <algorithm>
#include <atomic>
#include <mutex>

#include "asset/file/coarse_groups.hpp"
#include "asset/file/follow_reference.hpp"
#include "asset/file/format.hpp"
#include "asset/file/group_chunk.hpp"
#include "asset/file/page.hpp"
#include "asset/file/page_table.hpp"
#include "asset/instances/tree_file.hpp"
#include "base/hash.hpp"
#include "base/parallel.hpp"
#include "lod/verify/table_structure.hpp"

namespace umbel {

using asset::MeshEntry;
using asset::PageEntry;

namespace {

/// The tables of all meshes, and the page of each group.
struct AllTables {
  struct GroupLocation {
    uint32_t page = kNone, index = 0;
  };
  std::vector<lod::Tables> meshes;
  std::vector<std::vector<GroupLocation>> locations;  // by mesh and group
};

/// A decoded group.
struct Decoded {
  uint32_t mesh = kNone, group = kNone;
  std::vector<lod::ClusterGeometry> clusters;
};

[[noreturn]] void out_of_range(const char* what, uint64_t value, uint64_t count) {
  throw Error(ErrorCode::kInvalidArgument, std::string(what) + " is " + std::to_string(value) +
                                               ", but the asset has " + std::to_string(count));
}

}  // namespace

struct Asset::State {
  State(std::shared_ptr<const ByteSource> bytes, std::string given_name)
      : source(required(std::move(bytes))), name(std::move(given_name)) {}

  static std::shared_ptr<const ByteSource> required(std::shared_ptr<const ByteSource> bytes) {
    if (!bytes) throw Error(ErrorCode::kInvalidArgument, "the source of the asset is null");
    return bytes;
  }

  std::shared_ptr<const ByteSource> source;
  std::string name;
  asset::FileHeader header;
  asset::PageTable pages{header, *source};
  std::vector<AssetMesh> meshes;
  std::vector<asset::VertexFormat> formats;
  mutable std::mutex tables_mutex;
  mutable std::atomic<bool> has_tables = false;
  mutable AllTables tables;
  std::vector<InstancedMesh> instanced;
  mutable std::mutex instances_mutex;
  mutable std::atomic<bool> has_instances = false;
  mutable asset::StoredInstanceTree instances;
  mutable std::mutex coarse_mutex;
  mutable std::atomic<bool> has_coarse = false;
  mutable std::vector<asset::CoarseGroups> coarse;
  // A cache of decoded groups for geometry(): one a slot, by group number.
  static constexpr size_t kSlots = 16;
  mutable std::mutex decoded_mutex;
  mutable std::array<std::shared_ptr<const Decoded>, kSlots> decoded;

  /// Calls read(): what is wrong with the file is said with its name.
  template <typename Read>
  decltype(auto) naming(const Read& read) const {
    try {
      return read();
    } catch (const Error& error) {
      const std::string what = error.what();
      const bool of_file = error.code() == ErrorCode::kCorrupt || error.code() == ErrorCode::kIo ||
                           error.code() == ErrorCode::kUnsupported;
      if (!of_file || name.empty() || what.find(name + ":") != std::string::npos) throw;
      throw Error(error.code(), name + ": " + what);
    }
  }

  void read_header();
  void check_page(uint32_t page) const {
    if (page >= pages.size()) out_of_range("page", page, pages.size());
  }
  std::vector<std::byte> read(uint64_t offset, uint64_t bytes, uint64_t checksum,
                              const std::string& name) const;
  const asset::StoredInstanceTree& instance_tree() const;
  const Refinement* refinement(uint32_t mesh, uint32_t group) const;
  AssetPage read_page(uint32_t page) const;
  AssetPage page_of(uint32_t page, std::vector<std::byte> bytes) const;
  std::vector<lod::ClusterGeometry> decode(const AssetPage& page, size_t index) const;
  std::vector<lod::Node> read_nodes(const Range& range) const;
  AllTables read_tables() const;
  const AllTables& all_tables() const;
  std::shared_ptr<const Decoded> group(uint32_t mesh, uint32_t group) const;
};

void Asset::State::read_header() {
  std::vector<std::byte> bytes(asset::kPrologueBytes);
  const auto read_up_to = [&](uint64_t size) {
    if (size > source->size()) corrupt("the file ends within its header");
    const size_t have = bytes.size();
    bytes.resize(size);
    source->read(have, std::span(bytes).subspan(have));
  };
  if (source->size() < bytes.size()) corrupt("this is not a .umbel file");
  source->read(0, bytes);
  read_up_to(asset::fixed_header_bytes_in(bytes));
  read_up_to(asset::opening_bytes_in(bytes, source->size()));
  header = asset::decode_header(bytes);
  for (const MeshEntry& entry : header.meshes) {
    meshes.push_back(entry.mesh);
    formats.push_back(asset::format_of(header, entry));
  }
  for (size_t m = 0; m < header.coarsest_errors.size() && m < meshes.size(); ++m)
    instanced.push_back({meshes[m].bounds, header.coarsest_errors[m]});
}

void check_sum(std::span<const std::byte> bytes, uint64_t checksum, const std::string& name) {
  if (xxh64(bytes.data(), bytes.size()) != checksum)
    corrupt("the checksum of " + name + " does not hold");
}

std::vector<std::byte> Asset::State::read(uint64_t offset, uint64_t size, uint64_t checksum,
                                          const std::string& name) const {
  std::vector<std::byte> bytes(size);
  source->read(offset, bytes);
  check_sum(bytes, checksum, name);
  return bytes;
}

const asset::StoredInstanceTree& Asset::State::instance_tree() const {
  if (!has_instances.load(std::memory_order_acquire)) {
    const std::lock_guard lock(instances_mutex);
    if (!has_instances.load(std::memory_order_relaxed)) {
      const asset::TableSection& table = header.instance_nodes;
      if (table.count == 0) return instances;
      const std::vector<std::byte> bytes = read(table.offset, table.count * table.element_bytes,
                                                table.checksum, "the instances' nodes");
      instances =
          asset::decode_instance_nodes(bytes, table.count, table.element_bytes,
                                       header.instance_pages.count, header.instances.size());
      has_instances.store(true, std::memory_order_release);
    }
  }
  return instances;
}

const Refinement* Asset::State::refinement(uint32_t mesh, uint32_t group) const {
  if (header.coarse.count == 0) return nullptr;
  if (!has_coarse.load(std::memory_order_acquire)) {
    const std::lock_guard lock(coarse_mutex);
    if (!has_coarse.load(std::memory_order_relaxed)) {
      const asset::TableSection& table = header.coarse;
      coarse = asset::decode_coarse(read(table.offset, table.count * table.element_bytes,
                                         table.checksum, "the table of coarse groups"),
                                    header);
      has_coarse.store(true, std::memory_order_release);
    }
  }
  const auto& [first, groups] = coarse[mesh];
  return group < first || group - first >= groups.size() ? nullptr : &groups[group - first];
}

AssetPage Asset::State::read_page(uint32_t page) const {
  const PageEntry entry = pages.at(page);
  std::vector<std::byte> bytes(entry.bytes);
  source->read(entry.offset, bytes);
  return page_of(page, std::move(bytes));
}

AssetPage Asset::State::page_of(uint32_t page, std::vector<std::byte> bytes) const {
  const PageEntry entry = pages.at(page);
  const std::string name = "page " + std::to_string(page);
  if (bytes.size() != entry.bytes)
    corrupt(name + " has " + std::to_string(entry.bytes) + " bytes, but there are " +
            std::to_string(bytes.size()));
  check_sum(bytes, entry.checksum, name);
  return asset::decode_page(header, formats, page, entry.groups, std::move(bytes));
}

std::vector<lod::ClusterGeometry> Asset::State::decode(const AssetPage& page, size_t index) const {
  const PageGroup& group = page.groups[index];
  const auto chunk = std::span(page.bytes).subspan(group.offset, group.bytes);
  const asset::VertexFormat& format = formats[group.mesh];
  const auto tables = asset::decode_tables(
      format, meshes[group.mesh].bounds, group.group.clusters.count,
      static_cast<uint32_t>(group.children.size()), chunk, header.info.version_major);
  try {
    return asset::decode_clusters(format, tables, chunk, tables.clusters.size());
  } catch (const Error& error) {
    throw Error(error.code(), "group " + std::to_string(group.id) + ": " + error.what());
  }
}

AllTables Asset::State::read_tables() const {
  AllTables all;
  for (const MeshEntry& entry : header.meshes) {
    lod::Tables& tables = all.meshes.emplace_back();
    const auto levels = header.levels.begin() + entry.levels.offset;
    tables.levels.assign(levels, levels + entry.levels.count);
    tables.groups.resize(entry.mesh.groups);
    tables.clusters.resize(entry.mesh.clusters);
    all.locations.emplace_back(entry.mesh.groups);
  }
  std::vector<std::vector<GroupRef>> references(header.meshes.size());
  uint64_t found = 0;
  for (uint32_t p = 0; p < pages.size(); ++p) {
    const AssetPage page = read_page(p);
    for (uint32_t i = 0; i < page.groups.size(); ++i) {
      const PageGroup& group = page.groups[i];
      AllTables::GroupLocation& location = all.locations[group.mesh][group.id];
      if (location.page != kNone) corrupt("group " + std::to_string(group.id) + " is in two pages");
      location = {p, i};
      lod::Tables& tables = all.meshes[group.mesh];
      tables.groups[group.id] = group.group;
      std::copy(group.clusters.begin(), group.clusters.end(),
                tables.clusters.begin() + group.group.clusters.offset);
      asset::check_coarse(refinement(group.mesh, group.id), group);
      auto& known = references[group.mesh];
      known.insert(known.end(), group.children.begin(), group.children.end());
    }
    found += page.groups.size();
  }
  uint64_t groups = 0;
  for (const MeshEntry& entry : header.meshes) groups += entry.mesh.groups;
  if (found != groups)
    corrupt("the pages have " + std::to_string(found) + " groups, but the meshes " +
            std::to_string(groups));
  for (size_t m = 0; m < header.meshes.size(); ++m) {
    const MeshEntry& entry = header.meshes[m];
    // As many groups as the pages have, and none twice: so all are there.
    const auto roots = header.roots.begin() + entry.roots.offset;
    references[m].insert(references[m].end(), roots, roots + entry.roots.count);
    for (const GroupRef& reference : references[m]) {
      const lod::Group& group = all.meshes[m].groups[reference.group];
      if (all.locations[m][reference.group].page != reference.page ||
          !asset::agrees(reference, group))
        asset::disagree(reference);
    }
  }
  const std::vector<lod::Node> nodes = read_nodes({0, static_cast<uint32_t>(header.nodes.count)});
  for (size_t m = 0; m < header.meshes.size(); ++m) {
    const auto first = nodes.begin() + header.meshes[m].nodes.offset;
    all.meshes[m].nodes.assign(first, first + header.meshes[m].nodes.count);
    if (const std::string fault = lod::structure_fault(all.meshes[m]); !fault.empty())
      corrupt(fault);
  }
  return all;
}

std::vector<lod::Node> Asset::State::read_nodes(const Range& range) const {
  const asset::TableSection& table = header.nodes;
  std::vector<lod::Node> nodes;
  nodes.reserve(range.count);
  const uint64_t in_slice = table.slices.empty() ? table.count : asset::kSliceEntries;
  const uint64_t end = uint64_t{range.offset} + range.count;
  for (uint64_t at = range.offset; at < end;) {
    const uint64_t slice = at / in_slice, first = slice * in_slice;
    const std::vector<std::byte> bytes = asset::read_slice(*source, table, slice, "nodes");
    const std::vector<lod::Node> some =
        asset::decode_nodes(bytes, bytes.size() / table.element_bytes, table.element_bytes);
    const uint64_t last = std::min(end, first + some.size());
    nodes.insert(nodes.end(), some.begin() + static_cast<ptrdiff_t>(at - first),
                 some.begin() + static_cast<ptrdiff_t>(last - first));
    at = last;
  }
  return nodes;
}

const AllTables& Asset::State::all_tables() const {
  // Not std::call_once, which waits for ever under the thread sanitizer once a reading has failed.
  if (!has_tables.load(std::memory_order_acquire)) {
    const std::lock_guard lock(tables_mutex);
    if (!has_tables.load(std::memory_order_relaxed)) {
      tables = read_tables();
      has_tables.store(true, std::memory_order_release);
    }
  }
  return tables;
}

std::shared_ptr<const Decoded> Asset::State::group(uint32_t mesh, uint32_t group) const {
  auto& slot = decoded[group % kSlots];
  {
    const std::lock_guard lock(decoded_mutex);
    if (slot && slot->mesh == mesh && slot->group == group) return slot;
  }
  const AllTables::GroupLocation& location = all_tables().locations[mesh][group];
  auto result = std::make_shared<Decoded>();
  result->mesh = mesh;
  result->group = group;
  result->clusters = decode(read_page(location.page), location.index);
  const std::lock_guard lock(decoded_mutex);
  slot = result;
  return result;
}

Asset::Asset(std::shared_ptr<const ByteSource> source, std::string name)
    : state_(std::make_unique<State>(std::move(source), std::move(name))) {
  state_->naming([&] { state_->read_header(); });
}

Asset::Asset(const std::filesystem::path& path) : Asset(open_file(path), path.string()) {}

Asset::Asset(Asset&&) noexcept = default;
Asset& Asset::operator=(Asset&&) noexcept = default;
Asset::~Asset() = default;

const AssetInfo& Asset::info() const { return state_->header.info; }

const std::vector<AssetMesh>& Asset::meshes() const { return state_->meshes; }

const std::vector<Instance>& Asset::instances() const { return state_->header.instances; }

const std::vector<InstanceNode>& Asset::instance_nodes() const {
  return state_->naming(
      [&]() -> const std::vector<InstanceNode>& { return state_->instance_tree().nodes; });
}

bool Asset::has_instance_tree() const { return state_->header.instance_nodes.count > 0; }

uint32_t Asset::placement_bytes(uint32_t node) const {
  return state_->naming([&] {
    const asset::StoredInstanceTree& tree = state_->instance_tree();
    if (node >= tree.pages.size()) out_of_range("node of instances", node, tree.pages.size());
    return tree.pages[node].bytes;
  });
}

std::vector<Instance> Asset::placements(uint32_t node) const {
  return state_->naming([&] {
    const asset::StoredInstanceTree& tree = state_->instance_tree();
    if (node >= tree.pages.size()) out_of_range("node of instances", node, tree.pages.size());
    const asset::PlacementPage& page = tree.pages[node];
    const std::vector<std::byte> bytes =
        state_->read(state_->header.instance_pages.offset + page.offset, page.bytes, page.checksum,
                     "page " + std::to_string(node) + " of the instances");
    return asset::decode_placements(bytes, node, tree.nodes[node].placements,
                                    state_->meshes.size());
  });
}

const std::vector<InstancedMesh>& Asset::instanced_meshes() const { return state_->instanced; }

const std::string& Asset::materials() const { return state_->header.materials; }

const std::string& Asset::scene() const { return state_->header.scene; }

uint32_t Asset::files() const { return static_cast<uint32_t>(state_->header.files.size()); }

std::vector<std::byte> Asset::file(uint32_t index) const {
  return state_->naming([&] {
    if (index >= files()) out_of_range("file", index, files());
    const asset::FileEntry& entry = state_->header.files[index];
    return state_->read(entry.offset, entry.bytes, entry.checksum,
                        "embedded file " + std::to_string(index));
  });
}

std::span<const GroupRef> Asset::roots(uint32_t mesh) const {
  if (mesh >= state_->meshes.size()) out_of_range("mesh", mesh, state_->meshes.size());
  const Range& range = state_->header.meshes[mesh].roots;
  return std::span(state_->header.roots).subspan(range.offset, range.count);
}

const Refinement* Asset::refinement(uint32_t group, uint32_t mesh) const {
  return state_->naming([&] {
    if (mesh >= state_->meshes.size()) out_of_range("mesh", mesh, state_->meshes.size());
    return state_->refinement(mesh, group);
  });
}

std::span<const Range> Asset::levels(uint32_t mesh) const {
  if (mesh >= state_->meshes.size()) out_of_range("mesh", mesh, state_->meshes.size());
  const Range& range = state_->header.meshes[mesh].levels;
  return std::span(state_->header.levels).subspan(range.offset, range.count);
}

uint32_t Asset::page_bytes(uint32_t page) const {
  return state_->naming([&] {
    state_->check_page(page);
    return state_->pages.at(page).bytes;
  });
}

AssetPage Asset::read_page(uint32_t page) const {
  return state_->naming([&] {
    state_->check_page(page);
    return state_->read_page(page);
  });
}

AssetPage Asset::page_of(uint32_t page, std::vector<std::byte> bytes) const {
  return state_->naming([&] {
    state_->check_page(page);
    return state_->page_of(page, std::move(bytes));
  });
}

std::vector<lod::ClusterGeometry> Asset::decode(const AssetPage& page, size_t index) const {
  return state_->naming([&] {
    if (index >= page.groups.size()) out_of_range("group of the page", index, page.groups.size());
    const PageGroup& group = page.groups[index];
    if (group.mesh >= state_->meshes.size() || group.offset > page.bytes.size() ||
        group.bytes > page.bytes.size() - group.offset)
      throw Error(ErrorCode::kInvalidArgument, "the page is not one of this asset");
    return state_->decode(page, index);
  });
}

bool Asset::page_is_whole(uint32_t page) const {
  return state_->naming([&] {
    state_->check_page(page);
    const PageEntry entry = state_->pages.at(page);
    std::vector<std::byte> bytes(entry.bytes);
    state_->source->read(entry.offset, bytes);
    return xxh64(bytes.data(), bytes.size()) == entry.checksum;
  });
}

bool Asset::header_is_whole() const {
  return state_->naming([&] {
    std::vector<std::byte> bytes(info().header_bytes);
    state_->source->read(0, bytes);
    return asset::header_is_whole(bytes);
  });
}

std::vector<lod::Node> Asset::nodes(uint32_t mesh) const {
  return state_->naming([&] {
    if (mesh >= state_->meshes.size()) out_of_range("mesh", mesh, state_->meshes.size());
    return state_->read_nodes(state_->header.meshes[mesh].nodes);
  });
}

const lod::Tables& Asset::tables(uint32_t mesh) const {
  return state_->naming([&]() -> const lod::Tables& {
    static const lod::Tables empty;
    if (mesh == 0 && state_->meshes.empty()) return empty;
    if (mesh >= state_->meshes.size()) out_of_range("mesh", mesh, state_->meshes.size());
    return state_->all_tables().meshes[mesh];
  });
}

lod::ClusterGeometry Asset::geometry(uint32_t cluster, uint32_t mesh) const {
  return state_->naming([&] {
    const lod::Tables& tables = this->tables(mesh);
    if (cluster >= tables.clusters.size()) out_of_range("cluster", cluster, tables.clusters.size());
    const uint32_t group = tables.clusters[cluster].group;
    return state_->group(mesh, group)->clusters[cluster - tables.groups[group].clusters.offset];
  });
}

}  // namespace umbel
