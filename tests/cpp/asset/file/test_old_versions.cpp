// Files that earlier versions of the format wrote read the same for ever.
#include <gtest/gtest.h>

#include <bit>
#include <filesystem>
#include <string>
#include <vector>

#include "base/hash.hpp"
#include "umbel/asset.hpp"

namespace umbel {
namespace {

/// Bits of all that is read. Tangents and colours are left out: their last bit is the C library's.
class Digest {
 public:
  template <typename T>
  void add(const std::vector<T>& values) {
    static_assert(sizeof(T) % 4 == 0 || sizeof(T) == 1);
    const auto* const bytes = reinterpret_cast<const char*>(values.data());
    all_.insert(all_.end(), bytes, bytes + values.size() * sizeof(T));
  }
  uint64_t value() const { return xxh64(all_.data(), all_.size()); }

 private:
  std::vector<char> all_;
};

uint64_t digest_of(const Asset& asset) {
  Digest digest;
  const lod::Tables& tables = asset.tables(0);
  for (uint32_t c = 0; c < tables.clusters.size(); ++c) {
    const lod::Cluster& cluster = tables.clusters[c];
    const lod::ClusterGeometry geometry = asset.geometry(c);
    digest.add<uint32_t>({cluster.group, cluster.generating_group, cluster.material,
                          cluster.vertex_count, cluster.triangle_count});
    digest.add<Vec3>({cluster.box.min, cluster.box.max});
    digest.add(geometry.triangles);
    digest.add(geometry.positions);
    digest.add(geometry.normals);
    digest.add(geometry.uvs);
    digest.add(geometry.extra_values);
  }
  for (const lod::Group& group : tables.groups)
    digest.add<float>({group.error, group.sphere.center.x, group.sphere.radius});
  return digest.value();
}

struct Known {
  const char* name;
  uint64_t digest;
};

void expect_same_as_ever(uint16_t version, std::initializer_list<Known> files) {
  // Tests run in the repository's root.
  const std::filesystem::path folder = "tests/vectors/format" + std::to_string(version);
  for (const auto& [name, digest] : files) {
    const auto path = folder / (std::string(name) + ".umbel");
    const Asset asset(path);
    EXPECT_EQ(asset.info().version_major, version) << name;
    EXPECT_EQ(digest_of(asset), digest) << name;
    EXPECT_TRUE(asset.header_is_whole()) << name;
    const auto problems = verify_asset(path, 2).problems;
    EXPECT_TRUE(problems.empty()) << name << ": " << (problems.empty() ? "" : problems.front());
  }
}

TEST(OldVersions, files_of_version_3_read_as_they_always_did) {
  expect_same_as_ever(3, {{"floats", 0xdbbb5d6fcfbc4526},
                          {"grid", 0x7d001704660ca955},
                          {"seams", 0x34938299dde1f2e6}});
}

TEST(OldVersions, files_of_version_4_read_as_they_always_did) {
  expect_same_as_ever(4, {{"compact", 0xccc219e9fee4aabc},
                          {"creases", 0xd364fa78d591df12},
                          {"exact", 0xb60eb72df9232f64},
                          {"seams", 0x7a0accf36eee4040}});
}

TEST(OldVersions, files_of_version_5_read_as_they_always_did) {
  expect_same_as_ever(5, {{"compact", 0x1cfbe5fee1715ddf},
                          {"creases", 0x6ba638186fa693a0},
                          {"exact", 0x5a3c77aca8e55eaf},
                          {"seams", 0x852ba952264cc966}});
}

}  // namespace
}  // namespace umbel
