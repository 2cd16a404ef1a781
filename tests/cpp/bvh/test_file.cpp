#include <gtest/gtest.h>

#include "asset/scratch.hpp"
#include "base/hash.hpp"
#include "bvh/oracle.hpp"

namespace umbel {
namespace {

using namespace testing;

std::vector<TriangleBvhConfig> kinds() {
  std::vector<TriangleBvhConfig> all;
  for (const uint32_t width : {2u, 4u, 8u})
    for (const bool compact : {false, true}) {
      TriangleBvhConfig config;
      config.width = width, config.compact = compact;
      all.push_back(config);
    }
  return all;
}

/// Asks everything, as a query that leaves an array would be noticed by the sanitizers at least.
void ask_everything(const TriangleBvh& tree) {
  for (const Vec3& p : {Vec3{0, 0, 0}, Vec3{0.3f, -0.2f, 0.9f}, Vec3{5, 5, 5}}) {
    for (const Vec3& d : {Vec3{1, 0, 0}, Vec3{-0.3f, 0.4f, -0.8f}}) {
      tree.intersect({p, 0, d});
      tree.occluded({p, 0, d});
      std::array<Hit, 4> hits;
      tree.all_hits({p, 0, d}, hits);
    }
    tree.closest_point(p);
    tree.contains(p);
    tree.overlaps(Sphere{p, 0.5f});
    tree.overlaps(Aabb{{p.x - 1, p.y - 1, p.z - 1}, p});
  }
}

std::optional<ErrorCode> failure_of(const std::filesystem::path& path) {
  try {
    ask_everything(TriangleBvh::load(path.string()));
  } catch (const Error& error) {
    EXPECT_GT(std::string(error.what()).size(), 10u);
    return error.code();
  }
  return std::nullopt;
}

TEST(BvhFile, a_loaded_tree_answers_as_the_saved_one) {
  const Scratch scratch;
  const Mesh mesh = shapes::blob(3, 1);
  std::vector<uint32_t> masks(mesh.triangles.size());
  for (uint32_t i = 0; i < masks.size(); ++i) masks[i] = 1 + i % 3;
  const std::vector<Ray> rays = adversarial_rays(mesh.view(), 280, 1);
  for (const TriangleBvhConfig& config : kinds())
    for (const bool masked : {false, true}) {
      const std::string path = (scratch / "a.umbvh").string();
      const TriangleBvh saved =
          TriangleBvh::build(mesh.view(), config, masked ? masks : std::vector<uint32_t>{});
      saved.save(path);
      const TriangleBvh loaded = TriangleBvh::load(path);
      EXPECT_EQ(loaded.bounds(), saved.bounds());
      EXPECT_EQ(loaded.triangle_count(), saved.triangle_count());
      EXPECT_EQ(loaded.statistics().bytes, saved.statistics().bytes);
      EXPECT_EQ(loaded.statistics().sah_cost, saved.statistics().sah_cost);
      EXPECT_EQ(loaded.statistics().max_depth, saved.statistics().max_depth);
      for (const Ray& ray : rays) {
        ASSERT_EQ(loaded.intersect(ray), saved.intersect(ray));
        ASSERT_EQ(loaded.intersect(ray, {2}), saved.intersect(ray, {2}));
        ASSERT_EQ(loaded.closest_point(ray.origin).primitive,
                  saved.closest_point(ray.origin).primitive);
      }
      loaded.save((scratch / "b.umbvh").string());
      ASSERT_TRUE(read_bytes(scratch / "a.umbvh") == read_bytes(scratch / "b.umbvh"));
    }
  EXPECT_EQ(scratch.files(), 2u);
}

TEST(BvhFile, trees_of_every_builder_can_be_saved_and_loaded) {
  const Scratch scratch;
  for (const Mesh& mesh : {shapes::blob(2, 2), shapes::soup(100, 1), Mesh{}})
    for (const bvh::Builder builder : bvh::builders()) {
      TriangleBvhConfig config;
      config.tree = bvh::Config{};
      config.tree.builder = builder;
      TriangleBvh::build(mesh.view(), config).save((scratch / "a").string());
      EXPECT_EQ(failure_of(scratch / "a"), std::nullopt) << bvh::name(builder);
    }
}

TEST(BvhFile, a_loaded_tree_can_be_refitted) {
  const Scratch scratch;
  const Mesh mesh = shapes::blob(3, 1), moved = transformed(mesh, 3, {1, 2, 3});
  TriangleBvh::build(mesh.view()).save((scratch / "a").string());
  TriangleBvh tree = TriangleBvh::load((scratch / "a").string());
  const RefitReport report = tree.refit(moved.view());
  EXPECT_NEAR(report.sah_cost, report.built_sah_cost, 1e-4 * report.built_sah_cost);
  EXPECT_EQ(tree.bounds(), bounds(moved.view()));
}

TEST(BvhFile, any_byte_that_is_changed_is_noticed) {
  const Scratch scratch;
  for (const TriangleBvhConfig& config : kinds()) {
    TriangleBvh::build(shapes::sphere(0).view(), config).save((scratch / "a").string());
    const std::vector<char> whole = read_bytes(scratch / "a");
    ASSERT_LT(whole.size(), 4000u);
    for (size_t at = 0; at < whole.size(); ++at)
      for (const int flip : {0xff, 0x01}) {
        std::vector<char> bytes = whole;
        bytes[at] = static_cast<char>(bytes[at] ^ flip);
        write_bytes(scratch / "b", bytes);
        ASSERT_EQ(failure_of(scratch / "b"), ErrorCode::kCorrupt) << "byte " << at;
      }
  }
}

TEST(BvhFile, any_length_but_the_right_one_is_noticed) {
  const Scratch scratch;
  for (const TriangleBvhConfig& config : kinds()) {
    TriangleBvh::build(shapes::sphere(0).view(), config).save((scratch / "a").string());
    std::vector<char> bytes = read_bytes(scratch / "a");
    write_bytes(scratch / "b", bytes);
    for (size_t size = bytes.size(); size-- > 0;) {
      std::filesystem::resize_file(scratch / "b", size);
      ASSERT_EQ(failure_of(scratch / "b"), ErrorCode::kCorrupt) << size << " bytes";
    }
    bytes.push_back(0);
    write_bytes(scratch / "b", bytes);
    ASSERT_EQ(failure_of(scratch / "b"), ErrorCode::kCorrupt);
  }
}

// ---- files whose checksums are right and whose contents are not ---------------------------------

uint64_t get(const std::vector<char>& bytes, size_t at) {
  uint64_t value = 0;
  for (size_t i = 0; i < 8; ++i)
    value |= uint64_t{static_cast<unsigned char>(bytes[at + i])} << (8 * i);
  return value;
}

void put(std::vector<char>& bytes, size_t at, size_t size, uint64_t value) {
  for (size_t i = 0; i < size; ++i) bytes[at + i] = static_cast<char>(value >> (8 * i));
}

void repair_checksums(std::vector<char>& bytes) {
  for (size_t entry = 112; entry < 184; entry += 24) {
    const uint64_t offset = get(bytes, entry), size = get(bytes, entry + 8);
    if (offset > bytes.size() || size > bytes.size() - offset) continue;
    put(bytes, entry + 16, 8, xxh64(bytes.data() + offset, size));
  }
  put(bytes, 184, 8, xxh64(bytes.data(), 184));
}

TEST(BvhFile, repairing_checksums_repairs_nothing_in_a_whole_file) {
  const Scratch scratch;
  TriangleBvh::build(shapes::sphere(1).view()).save((scratch / "a").string());
  const std::vector<char> whole = read_bytes(scratch / "a");
  std::vector<char> bytes = whole;
  repair_checksums(bytes);
  EXPECT_TRUE(bytes == whole);
}

TEST(BvhFile, wrong_words_under_right_checksums_are_errors_or_harmless) {
  const Scratch scratch;
  for (const TriangleBvhConfig& config : kinds()) {
    TriangleBvh::build(shapes::sphere(1).view(), config).save((scratch / "a").string());
    const std::vector<char> whole = read_bytes(scratch / "a");
    size_t refused = 0;
    for (size_t at = 0; at + 4 <= whole.size(); at += 4)
      for (const uint64_t value : {0xffffffffu, 0x7fffffffu, 0u, 1u, 0x80000000u, 0xf0000005u}) {
        std::vector<char> bytes = whole;
        put(bytes, at, 4, value);
        repair_checksums(bytes);
        write_bytes(scratch / "b", bytes);
        const std::optional<ErrorCode> failure = failure_of(scratch / "b");
        if (!failure) continue;
        ++refused;
        ASSERT_TRUE(*failure == ErrorCode::kCorrupt || *failure == ErrorCode::kUnsupported)
            << "byte " << at;
      }
    EXPECT_GT(refused, 300u);
  }
}

TEST(BvhFile, random_changes_under_right_checksums_never_crash) {
  const Scratch scratch;
  uint64_t state = 7;
  for (const TriangleBvhConfig& config : kinds()) {
    TriangleBvh::build(shapes::blob(2, 1).view(), config).save((scratch / "a").string());
    const std::vector<char> whole = read_bytes(scratch / "a");
    for (int run = 0; run < 400; ++run) {
      std::vector<char> bytes = whole;
      for (uint64_t change = mix64(++state) % 4 + 1; change > 0; --change) {
        const size_t at = mix64(++state) % (run % 4 ? bytes.size() : 1024);
        bytes[at] = static_cast<char>(mix64(++state));
      }
      repair_checksums(bytes);
      write_bytes(scratch / "b", bytes);
      (void)failure_of(scratch / "b");
    }
  }
}

TEST(BvhFile, a_newer_version_is_unsupported) {
  const Scratch scratch;
  TriangleBvh::build(shapes::sphere(1).view()).save((scratch / "a").string());
  std::vector<char> bytes = read_bytes(scratch / "a");
  put(bytes, 8, 2, 2);
  repair_checksums(bytes);
  write_bytes(scratch / "b", bytes);
  EXPECT_EQ(failure_of(scratch / "b"), ErrorCode::kUnsupported);
}

TEST(BvhFile, files_that_are_none_are_refused) {
  const Scratch scratch;
  EXPECT_EQ(failure_of(scratch / "missing"), ErrorCode::kIo);
  EXPECT_EQ(failure_of(std::filesystem::temp_directory_path()), ErrorCode::kIo);
  if (std::filesystem::exists("/dev/zero")) {
    EXPECT_EQ(failure_of("/dev/zero"), ErrorCode::kIo);
  }
}

TEST(BvhFile, what_cannot_be_written_leaves_what_was_there) {
  const Scratch scratch;
  const TriangleBvh tree = TriangleBvh::build(shapes::sphere(1).view());
  EXPECT_THROW(tree.save((scratch / "no_folder" / "a").string()), Error);
  EXPECT_THROW(tree.save(std::filesystem::temp_directory_path().string()), Error);
  if (std::filesystem::exists("/dev/full")) {
    EXPECT_THROW(tree.save("/dev/full"), Error);
  }
  tree.save((scratch / "a").string());
  tree.save((scratch / "a").string());
  EXPECT_EQ(scratch.files(), 1u);
}

}  // namespace
}  // namespace umbel
