// Fuzzes the reading of .umbvh files and the queries on what was read: the bytes are a file, whose
// checksums are repaired so that what lies behind them is reached. Any file must be refused with a
// sentence, or give a tree whose queries stay within its arrays and come to an end.
#include <array>
#include <cmath>
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
#include "umbel/triangle_bvh.hpp"

namespace {

using umbel::TriangleBvh;
using umbel::Vec3;

[[noreturn]] void fail(const std::string& what) {
  std::fprintf(stderr, "fuzz_bvh: %s\n", what.c_str());
  std::abort();
}

// ---- the file's checksums (docs/bvh.md) --------------------------------------------------------

constexpr size_t kHeaderBytes = 192, kFirstSection = 112, kSectionBytes = 24;

uint64_t get(const std::vector<uint8_t>& bytes, size_t at) {
  uint64_t value = 0;
  for (size_t i = 0; i < 8; ++i) value |= uint64_t{bytes[at + i]} << (8 * i);
  return value;
}

void put(std::vector<uint8_t>& bytes, size_t at, uint64_t value) {
  for (size_t i = 0; i < 8; ++i) bytes[at + i] = static_cast<uint8_t>(value >> (8 * i));
}

void repair_checksums(std::vector<uint8_t>& bytes) {
  if (bytes.size() < kHeaderBytes) return;
  put(bytes, 16, bytes.size());
  for (size_t s = 0; s < 3; ++s) {
    const size_t entry = kFirstSection + s * kSectionBytes;
    const uint64_t offset = get(bytes, entry), size = get(bytes, entry + 8);
    if (offset > bytes.size() || size > bytes.size() - offset) continue;
    put(bytes, entry + 16, umbel::xxh64(bytes.data() + offset, size));
  }
  put(bytes, kHeaderBytes - 8, umbel::xxh64(bytes.data(), kHeaderBytes - 8));
}

const std::filesystem::path& scratch() {
  static const std::filesystem::path path =
      std::filesystem::temp_directory_path() /
      ("umbel_fuzz_" + std::to_string(std::random_device{}()) + ".umbvh");
  return path;
}

void write_file(const std::vector<uint8_t>& bytes) {
  std::ofstream file(scratch(), std::ios::binary);
  file.write(reinterpret_cast<const char*>(bytes.data()),
             static_cast<std::streamsize>(bytes.size()));
  if (!file.flush()) fail("the scratch file cannot be written");
}

// ---- queries -----------------------------------------------------------------------------------

void check_hit(const TriangleBvh& tree, const umbel::Hit& hit) {
  if (hit.hit() && hit.primitive >= tree.triangle_count()) fail("a hit of no triangle");
}

void ask(const TriangleBvh& tree, const Vec3& p, const Vec3& d) {
  const umbel::Ray ray{p, 0, d};
  const umbel::Hit hit = tree.intersect(ray);
  check_hit(tree, hit);
  if (tree.occluded(ray) != hit.hit()) fail("closest and any hit disagree");
  std::array<umbel::Hit, 5> hits;
  const size_t count = tree.all_hits(ray, hits);
  if ((count > 0) != hit.hit()) fail("closest and all hits disagree");
  for (size_t i = 0; i < count; ++i) check_hit(tree, hits[i]);
  const umbel::ClosestPoint closest = tree.closest_point(p);
  if (closest.primitive != umbel::kNone && closest.primitive >= tree.triangle_count())
    fail("a closest point on no triangle");
  tree.contains(p);
  for (const uint32_t primitive : tree.overlaps(umbel::Sphere{p, 0.25f}))
    if (primitive >= tree.triangle_count()) fail("an overlap of no triangle");
  tree.overlaps(umbel::Aabb{{p.x - 0.5f, p.y - 0.5f, p.z - 0.5f}, p});
}

void ask_everything(const TriangleBvh& tree) {
  const umbel::Aabb box = tree.bounds();
  ask(tree, {0, 0, 0}, {1, 0, 0});
  ask(tree, {0.1f, 0.2f, 0.3f}, {-0.5f, 0.25f, 1});
  ask(tree, box.min, {box.max.x - box.min.x, box.max.y - box.min.y, box.max.z - box.min.z});
  ask(tree, box.max, {0, -1, 0});
}

// ---- seeds -------------------------------------------------------------------------------------

// Whole files, without which no mutation would ever get past the magic.
std::vector<std::vector<uint8_t>> make_seeds() {
  std::vector<std::vector<uint8_t>> seeds;
  for (const umbel::Mesh& mesh :
       {umbel::shapes::sphere(1), umbel::shapes::soup(20, 1), umbel::Mesh{}})
    for (const uint32_t width : {2u, 4u, 8u})
      for (const bool compact : {false, true}) {
        umbel::TriangleBvhConfig config;
        config.width = width, config.compact = compact;
        std::vector<uint32_t> masks;
        if (compact) masks.assign(mesh.triangles.size(), 5);
        TriangleBvh::build(mesh.view(), config, masks).save(scratch().string());
        std::ifstream file(scratch(), std::ios::binary);
        seeds.emplace_back(std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>());
      }
  return seeds;
}

// The first byte chooses a whole file, the rest says what to change in it; with a first byte of
// 255 the rest is the file.
std::vector<uint8_t> file_of(const uint8_t* data, size_t size) {
  static const std::vector<std::vector<uint8_t>> seeds = make_seeds();
  if (size == 0) return {};
  if (data[0] == 255) return {data + 1, data + size};
  std::vector<uint8_t> bytes = seeds[data[0] % seeds.size()];
  for (size_t i = 1; i + 4 <= size; i += 4) {
    const size_t word = (data[i] | size_t{data[i + 1]} << 8) % (bytes.size() / 4);
    const size_t at = 4 * word + data[i + 2] % 4;
    bytes[at] = data[i + 3];
    // Large numbers are beyond most ranges, and small ones within.
    if (data[i + 2] & 0x40) std::memset(&bytes[4 * word], data[i + 3], 4);
    if (data[i + 2] & 0x80) bytes.resize(bytes.size() - data[i + 3] % 64);
    if (bytes.size() < 8) break;
  }
  return bytes;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  std::vector<uint8_t> bytes = file_of(data, size);
  repair_checksums(bytes);
  write_file(bytes);
  try {
    TriangleBvh tree = TriangleBvh::load(scratch().string());
    ask_everything(tree);
  } catch (const umbel::Error& error) {
    if (error.what()[0] == '\0') fail("an error without a sentence");
  }
  return 0;
}
