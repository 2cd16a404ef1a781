// Fuzzes the reading of .umbel files: the bytes are a file, whose checksums are repaired so that
// what lies behind them is reached. Any file must be read, or refused with a sentence.
#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <span>
#include <string>
#include <vector>

#include "asset/file/format.hpp"
#include "base/hash.hpp"
#include "scratch.hpp"
#include "umbel/asset.hpp"
#include "umbel/instance_tree.hpp"
#include "umbel/umbel.h"
#include "umbel/umbel.hpp"

namespace {

using umbel::xxh64;
using umbel::fuzz::scratch;

[[noreturn]] void fail(const std::string& what) {
  std::fprintf(stderr, "fuzz_asset: %s\n", what.c_str());
  std::abort();
}

// ---- the file's checksums (docs/format.md) -----------------------------------------------------

constexpr size_t kHeaderBytes = 128, kSectionBytes = 40, kElementBytes = 24;

uint64_t get(const std::vector<uint8_t>& bytes, size_t at, size_t size) {
  uint64_t value = 0;
  for (size_t i = 0; i < size; ++i) value |= uint64_t{bytes[at + i]} << (8 * i);
  return value;
}

void put(std::vector<uint8_t>& bytes, size_t at, uint64_t value) {
  for (size_t i = 0; i < 8; ++i) bytes[at + i] = static_cast<uint8_t>(value >> (8 * i));
}

void repair(std::vector<uint8_t>& bytes, size_t checksum_at, size_t offset, size_t size) {
  if (offset <= bytes.size() && size <= bytes.size() - offset)
    put(bytes, checksum_at, xxh64(bytes.data() + offset, size));
}

// Of the tables whose elements have an offset, a size of `size_bytes` bytes, and end in a checksum.
void repair_elements(std::vector<uint8_t>& bytes, size_t table, size_t size, size_t size_bytes) {
  for (size_t i = 0; i + kElementBytes <= size; i += kElementBytes)
    repair(bytes, table + i + 16, get(bytes, table + i, 8), get(bytes, table + i + 8, size_bytes));
}

struct SectionAt {
  size_t entry = 0, offset = 0, size = 0;
};

/// A section that lies within the file, by its name; else one without bytes.
SectionAt find_section(const std::vector<uint8_t>& bytes, const char* name) {
  const size_t header = get(bytes, 12, 4);
  const uint64_t sections = std::min<uint64_t>(get(bytes, 40, 4), 32);
  for (uint64_t s = 0; s < sections; ++s) {
    const size_t entry = header + s * kSectionBytes;
    if (entry + kSectionBytes > bytes.size()) break;
    if (std::memcmp(&bytes[entry], name, 4) != 0) continue;
    const size_t offset = get(bytes, entry + 8, 8), size = get(bytes, entry + 16, 8);
    if (offset <= bytes.size() && size <= bytes.size() - offset) return {entry, offset, size};
  }
  return {};
}

// Of nodes of instances, whose pages are counted from the start of a section of their own.
void repair_instances(std::vector<uint8_t>& bytes) {
  constexpr size_t kNodeBytes = 64;
  const SectionAt nodes = find_section(bytes, "ITRE"), pages = find_section(bytes, "IPAG");
  for (size_t at = nodes.offset; at + kNodeBytes <= nodes.offset + nodes.size; at += kNodeBytes) {
    const uint64_t offset = get(bytes, at + 40, 8), size = get(bytes, at + 48, 4);
    if (offset <= pages.size && size <= pages.size - offset)
      repair(bytes, at + 56, pages.offset + offset, size);
  }
}

// Of a table of less than two slices.
void repair_slice(std::vector<uint8_t>& bytes, const char* name, const char* sums) {
  const SectionAt table = find_section(bytes, name), slices = find_section(bytes, sums);
  if (slices.size >= 8) repair(bytes, slices.offset, table.offset, table.size);
}

void repair_checksums(std::vector<uint8_t>& bytes) {
  if (bytes.size() < kHeaderBytes) return;
  const size_t header = get(bytes, 12, 4);
  if (header < kHeaderBytes || header > bytes.size()) return;
  const SectionAt pages = find_section(bytes, "PAGE"), files = find_section(bytes, "FILE");
  repair_elements(bytes, pages.offset, pages.size, 4);
  repair_elements(bytes, files.offset, files.size, 8);
  repair_instances(bytes);
  repair_slice(bytes, "PAGE", "PSUM");
  repair_slice(bytes, "NODE", "NSUM");
  const uint64_t sections = std::min<uint64_t>(get(bytes, 40, 4), 32);
  for (uint64_t s = 0; s < sections; ++s) {
    const size_t entry = header + s * kSectionBytes;
    if (entry + kSectionBytes > bytes.size()) break;
    if (std::memcmp(&bytes[entry], "IPAG", 4) != 0)
      repair(bytes, entry + 32, get(bytes, entry + 8, 8), get(bytes, entry + 16, 8));
  }
  const size_t header_end = get(bytes, 24, 8);
  if (header_end >= header && header_end <= bytes.size())
    put(bytes, 32, xxh64(bytes.data() + header, header_end - header));
  // What comes before a table of pages with checksums of its slices has a checksum of its own.
  const size_t opening = get(bytes, 56, 8);
  if (opening > header && opening <= header_end) repair(bytes, 64, header, opening - header);
  put(bytes, header - 8, xxh64(bytes.data(), header - 8));
}

// ---- a file for the bytes ----------------------------------------------------------------------

void write_file(const std::filesystem::path& path, const std::vector<uint8_t>& bytes) {
  std::ofstream file(path, std::ios::binary);
  file.write(reinterpret_cast<const char*>(bytes.data()),
             static_cast<std::streamsize>(bytes.size()));
  if (!file.flush()) fail("a file cannot be written");
}

std::vector<uint8_t> bytes_of(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

// ---- seeds -------------------------------------------------------------------------------------

// Gives every vertex every attribute.
umbel::Mesh with_attributes(umbel::Mesh mesh) {
  const size_t count = mesh.positions.size();
  mesh.normals.assign(count, {0, 0, 1});
  mesh.tangents.assign(count, {1, 0, 0, 1});
  mesh.uvs.resize(count);
  mesh.colors.assign(count, {1, 0.5f, 0, 1});
  for (size_t i = 0; i < count; ++i) mesh.uvs[i] = {mesh.positions[i].x, mesh.positions[i].y};
  mesh.extras = {
      {umbel::ExtraKind::kUvs, 1}, {umbel::ExtraKind::kJoints, 0}, {umbel::ExtraKind::kWeights, 0}};
  for (size_t i = 0; i < count; ++i) {
    const float x = mesh.positions[i].x;
    const float values[] = {2 * x, 1, 0, float(i % 3), 2, 3, x, 1 - x, 0, 0};
    mesh.extra_values.insert(mesh.extra_values.end(), std::begin(values), std::end(values));
  }
  return mesh;
}

umbel::BuildOptions one_thread() {
  umbel::BuildOptions options;
  options.threads = 1;
  return options;
}

umbel::lod::Dag small_dag(const umbel::Mesh& mesh, bool mix_materials = false) {
  umbel::lod::Config config;
  config.max_triangles = 16;
  config.min_group = 2;
  config.max_group = 4;
  config.mix_materials = mix_materials;
  return umbel::lod::build(mesh.view(), config, one_thread());
}

// The file as it were if its tables of pages and nodes were long enough to be read in slices.
std::vector<uint8_t> with_slices(const std::vector<uint8_t>& whole) {
  using namespace umbel::asset;
  const std::span file = std::as_bytes(std::span(whole));
  const auto opening = opening_bytes_in(file.first(kHeaderBytes), file.size());
  FileHeader header = decode_header(file.first(opening));
  header.has_page_slices = true;
  header.nodes.slices = slice_checksums(
      file.subspan(header.nodes.offset, header.nodes.count * kNodeBytes), kNodeBytes);
  const uint64_t more = header_bytes(header) - opening;
  for (PageEntry& page : header.pages) page.offset += more;
  for (FileEntry& embedded : header.files) embedded.offset += more;
  header.nodes.offset += more;
  if (header.instance_nodes.count > 0) {
    header.instance_nodes.offset += more;
    header.instance_pages.offset += more;
  }
  header.info.file_bytes += more;
  const std::vector<std::byte> made = encode_header(header);
  std::vector<uint8_t> bytes(made.size());
  std::memcpy(bytes.data(), made.data(), made.size());
  bytes.insert(bytes.end(), whole.begin() + static_cast<ptrdiff_t>(opening), whole.end());
  return bytes;
}

// A tree of few instances: of one leaf, or of a root and its leaves.
void write_forest(const std::filesystem::path& path, const umbel::lod::Dag& one,
                  const umbel::lod::Dag& other, uint32_t count) {
  umbel::AssetContents forest;
  forest.meshes = {&one, &other};
  forest.most_listed_instances = 8;
  for (uint32_t i = 0; i < count; ++i) {
    const uint32_t row = i / 32;
    const auto x = static_cast<float>(3 * (i % 32)), y = static_cast<float>(3 * row);
    forest.instances.push_back({i % 2, {1, 0, 0, x, 0, 1, 0, y, 0, 0, 1, 0}});
  }
  umbel::write_asset(path, forest);
}

// Whole files, without which no mutation would ever get past the magic.
void write_seeds(const std::filesystem::path& folder) {
  const umbel::lod::Dag sphere = small_dag(umbel::shapes::sphere(2));
  umbel::Mesh mixed = with_attributes(umbel::shapes::grid(8, 8));
  for (size_t t = 0; t < mixed.triangles.size(); ++t)
    mixed.materials.push_back(static_cast<uint32_t>(t % 2));
  const umbel::lod::Dag grid = small_dag(mixed, true);
  umbel::write_asset(folder / "empty.umbel", small_dag({}));
  umbel::write_asset(folder / "tetrahedron.umbel", small_dag(umbel::shapes::tetrahedra(1)));
  umbel::write_asset(folder / "sphere.umbel", sphere);
  umbel::write_asset(folder / "attributes.umbel",
                     small_dag(with_attributes(umbel::shapes::grid(8, 8))));
  umbel::write_asset(folder / "exact.umbel", grid, "{}", {}, umbel::AssetConfig::exact());
  umbel::AssetContents scene;
  scene.meshes = {&sphere, &grid};
  scene.instances = {{0}, {1, {2, 0, 0, 1, 0, 2, 0, 1, 0, 0, 2, 1}}, {0}};
  scene.first_materials = {0, 1};
  scene.files = {{std::byte{1}, std::byte{2}}, {}};
  scene.origin = {500000, 4649776, 312.5};
  scene.scene = "{\"nodes\": []}";
  umbel::write_asset(folder / "scene.umbel", scene);
  const umbel::lod::Dag small = small_dag(umbel::shapes::tetrahedra(1));
  write_forest(folder / "few_instances.umbel", sphere, small, 9);
  write_forest(folder / "many_instances.umbel", small, small, 600);
  write_forest(folder / "whole.umbel", grid, small, 20);
  write_file(folder / "sliced.umbel", with_slices(bytes_of(folder / "whole.umbel")));
  for (const char* name : {"few_instances.umbel", "many_instances.umbel", "sliced.umbel"}) {
    std::vector<uint8_t> bytes = bytes_of(folder / name);
    if (!umbel::verify_asset(folder / name, 2, 1, one_thread()).ok) fail("a seed is damaged");
    const std::vector<uint8_t> written = bytes;
    repair_checksums(bytes);
    if (bytes != written) fail("checksums that hold are repaired");
  }
}

// As levels of detail are streamed: through the C interface, from memory.
void stream(const std::vector<uint8_t>& bytes, uint32_t meshes) {
  const auto read = [](void* user, uint64_t offset, uint64_t size, void* out) {
    std::memcpy(out, static_cast<const uint8_t*>(user) + offset, size);
    return 0;
  };
  umbel_asset* asset = nullptr;
  if (umbel_asset_open_source(bytes.size(), read, const_cast<uint8_t*>(bytes.data()), &asset))
    return;
  umbel_residency* residency = nullptr;
  umbel_residency_config config;
  umbel_residency_config_init(&config);
  config.budget_bytes = bytes.size() / 2;
  config.threads = 1;
  umbel_residency_create(asset, &config, &residency);
  umbel_stream_step step;
  umbel_stream_step_init(&step);
  const umbel_plane plane{{1, 0, 0}, 0};
  const umbel_stream_view views[] = {
      {0, {UMBEL_LOD_BY_CAMERA, 0, {0, 0, 2}, 0.01f, 0}, &plane, 1},
      {meshes / 2, {UMBEL_LOD_BY_ERROR, 0.01f, {}, 0, 0}, nullptr, 0}};
  for (int round = 0; residency && round < 3; ++round)
    if (umbel_residency_step(residency, views, 2, round, &step) == UMBEL_ERROR_INTERNAL)
      fail(umbel_last_error());
  size_t count = 0;
  if (residency) umbel_residency_cut(residency, nullptr, 0, &count);
  std::vector<umbel_stream_cluster> cut(count);
  if (count > 0) umbel_residency_cut(residency, cut.data(), count, &count);
  std::vector<umbel_vec3> positions(256), normals(256);
  std::vector<uint8_t> triangles(3 * 256);
  for (const umbel_stream_cluster& cluster : cut) {
    umbel_cluster_geometry geometry;
    umbel_cluster_geometry_init(&geometry);
    geometry.positions = positions.data();
    geometry.normals = normals.data();
    geometry.triangles = triangles.data();
    if (umbel_residency_cluster(residency, &cluster, &geometry) == UMBEL_ERROR_INTERNAL)
      fail(umbel_last_error());
  }
  umbel_residency_free(residency);
  umbel_asset_free(asset);
}

// What is shown of a tree: nothing that is not there, and as many instances as there are.
void select_instances(const umbel::Asset& asset) {
  const auto& nodes = asset.instance_nodes();
  umbel::InstanceSelector selector(asset, 1000);
  selector.step(umbel::lod::view_error(0));
  for (const float error : {3.4e38f, 1.0f, 0.0f}) {
    const umbel::InstanceStep step = selector.settle(umbel::lod::view_error(error));
    uint64_t shown = 0;
    for (const umbel::InstanceRun& run : step.runs) {
      const auto placements = selector.placements(run);
      for (const umbel::Instance& instance : placements)
        if (instance.mesh >= asset.meshes().size()) fail("an instance of no mesh is shown");
      shown += placements.size();
    }
    if (shown != step.shown || !step.missing.empty()) fail("a step says something else");
  }
  for (uint32_t n = 0; n < nodes.size(); ++n)
    if (asset.placements(n).size() != nodes[n].placements) fail("a page has other placements");
}

void read_everything(const umbel::Asset& asset) {
  if (asset.has_instance_tree()) select_instances(asset);
  for (uint32_t page = 0; page < asset.info().pages; ++page) asset.page_is_whole(page);
  for (uint32_t file = 0; file < asset.files(); ++file) asset.file(file);
  for (uint32_t mesh = 0; mesh < asset.meshes().size(); ++mesh) {
    const auto most = umbel::view_for_triangles(asset, umbel::lod::view_error(0), 100);
    umbel::mesh_of_clusters(asset, umbel::clusters_of_cut(asset, most, mesh));
    const umbel::lod::Tables& tables = asset.tables(mesh);
    const auto view = umbel::lod::view_error(umbel::lod::error_for_triangles(tables, 100));
    const auto geometry = [&](uint32_t cluster) { return asset.geometry(cluster, mesh); };
    umbel::lod::mesh_of_cut(tables, geometry, umbel::lod::select(tables, view));
    umbel::lod::mesh_of_cut(tables, geometry, umbel::lod::select_hierarchy(tables, view));
  }
}

}  // namespace

extern "C" int LLVMFuzzerInitialize(int* argc, char*** argv) {
  for (int i = 1; i < *argc; ++i)
    if (std::filesystem::is_directory((*argv)[i])) {
      write_seeds((*argv)[i]);
      break;
    }
  return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  std::vector<uint8_t> bytes(data, data + size);
  if (size % 8 != 7) repair_checksums(bytes);
  write_file(scratch(), bytes);
  const auto report = umbel::verify_asset(scratch(), 2, 1, one_thread());
  if (!report.ok && report.problems.empty()) fail("a file is not ok, and nothing is said of it");
  const auto paged = umbel::verify_asset_within(uint64_t{1} << 30, scratch(), 2, 1, one_thread());
  if (paged.ok && report.limit_violations + report.checksum_errors > 0)
    fail("only verification from tables finds what is wrong");
  try {
    const umbel::Asset asset(scratch());
    if (size % 4 == 0) stream(bytes, static_cast<uint32_t>(asset.meshes().size()));
    read_everything(asset);
  } catch (const umbel::Error& error) {
    const bool expected = error.code() == umbel::ErrorCode::kCorrupt ||
                          error.code() == umbel::ErrorCode::kUnsupported;
    if (!expected) fail(error.what());
  }
  return 0;
}
