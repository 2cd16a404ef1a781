// Fuzzes the reading of .umbel files: the bytes are a file, whose checksums are repaired so that
// what lies behind them is reached. Any file must be read, or refused with a sentence.
#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <random>
#include <string>
#include <vector>

#include "base/hash.hpp"
#include "umbel/asset.hpp"
#include "umbel/umbel.hpp"

namespace {

using umbel::xxh64;

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

void repair_checksums(std::vector<uint8_t>& bytes) {
  if (bytes.size() < kHeaderBytes) return;
  const size_t header = get(bytes, 12, 4);
  if (header < kHeaderBytes || header > bytes.size()) return;
  const uint64_t sections = std::min<uint64_t>(get(bytes, 40, 4), 16);
  for (const bool pages : {true, false})
    for (uint64_t s = 0; s < sections; ++s) {
      const size_t entry = header + s * kSectionBytes;
      if (entry + kSectionBytes > bytes.size()) break;
      const size_t offset = get(bytes, entry + 8, 8), size = get(bytes, entry + 16, 8);
      if (offset > bytes.size() || size > bytes.size() - offset) continue;
      if (pages && std::memcmp(&bytes[entry], "PAGE", 4) == 0)
        repair_elements(bytes, offset, size, 4);
      if (pages && std::memcmp(&bytes[entry], "FILE", 4) == 0)
        repair_elements(bytes, offset, size, 8);
      if (!pages) repair(bytes, entry + 32, offset, size);
    }
  const size_t head = get(bytes, 24, 8);
  if (head >= header && head <= bytes.size())
    put(bytes, 32, xxh64(bytes.data() + header, head - header));
  put(bytes, header - 8, xxh64(bytes.data(), header - 8));
}

// ---- a file for the bytes ----------------------------------------------------------------------

const std::filesystem::path& scratch() {
  static const std::filesystem::path path =
      std::filesystem::temp_directory_path() /
      ("umbel_fuzz_" + std::to_string(std::random_device{}()) + ".umbel");
  return path;
}

void write_file(const std::vector<uint8_t>& bytes) {
  std::ofstream file(scratch(), std::ios::binary);
  file.write(reinterpret_cast<const char*>(bytes.data()),
             static_cast<std::streamsize>(bytes.size()));
  if (!file.flush()) fail("the scratch file cannot be written");
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
  return mesh;
}

// Whole files, without which no mutation would ever get past the magic.
void write_seeds(const std::filesystem::path& folder) {
  umbel::BuildOptions one_thread;
  one_thread.threads = 1;
  const auto write = [&](const char* name, const umbel::Mesh& mesh, uint32_t max_triangles) {
    umbel::lod::Config config;
    config.max_triangles = max_triangles;
    config.min_group = 2;
    config.max_group = 4;
    umbel::write_asset(folder / name, umbel::lod::build(mesh.view(), config, one_thread));
  };
  write("empty.umbel", umbel::Mesh{}, 128);
  write("tetrahedron.umbel", umbel::shapes::tetrahedra(1), 128);
  write("sphere.umbel", umbel::shapes::sphere(2), 16);
  write("attributes.umbel", with_attributes(umbel::shapes::grid(8, 8)), 16);
}

void read_everything(const std::filesystem::path& path) {
  const umbel::Asset asset(path);
  const umbel::lod::Tables& tables = asset.tables();
  for (uint32_t page = 0; page < asset.info().pages; ++page) asset.page_is_whole(page);
  for (uint32_t file = 0; file < asset.files(); ++file) asset.file(file);
  const auto view = umbel::lod::view_error(umbel::lod::error_for_triangles(tables, 100));
  const auto geometry = [&](uint32_t cluster) { return asset.geometry(cluster); };
  umbel::lod::cut_mesh(tables, geometry, umbel::lod::select(tables, view));
  umbel::lod::cut_mesh(tables, geometry, umbel::lod::select_hierarchy(tables, view));
}

}  // namespace

extern "C" int LLVMFuzzerInitialize(int* argc, char*** argv) {
  for (int i = 1; i < *argc; ++i)
    if (std::filesystem::is_directory((*argv)[i])) {
      write_seeds((*argv)[i]);
      break;
    }
  std::atexit([] { std::filesystem::remove(scratch()); });
  return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  std::vector<uint8_t> bytes(data, data + size);
  if (size % 8 != 7) repair_checksums(bytes);
  write_file(bytes);
  umbel::BuildOptions one_thread;
  one_thread.threads = 1;
  const auto report = umbel::verify_asset(scratch(), 2, 1, one_thread);
  if (!report.ok && report.problems.empty()) fail("a file is not ok, and nothing is said of it");
  try {
    read_everything(scratch());
  } catch (const umbel::Error& error) {
    const bool expected = error.code() == umbel::ErrorCode::kCorrupt ||
                          error.code() == umbel::ErrorCode::kUnsupported;
    if (!expected) fail(error.what());
  }
  return 0;
}
