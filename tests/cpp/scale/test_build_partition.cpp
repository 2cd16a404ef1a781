#include <gtest/gtest.h>

#include <map>

#include "scale/build_partition.hpp"
#include "scale/units.hpp"

namespace umbel::scale::testing {
namespace {

Partition partition_of(const Mesh& mesh, const PartitionConfig& config) {
  const io::MeshSource source(mesh.view(), {0, 0, 0}, "mesh");
  return build_partition(source, {}, bounds(mesh.view()), config);
}

std::map<uint32_t, size_t> sizes_of(const Mesh& mesh, const Partition& partition) {
  std::map<uint32_t, size_t> sizes;
  for (const Triangle& t : mesh.triangles)
    ++sizes[partition.leaf(
        centroid(mesh.positions[t[0]], mesh.positions[t[1]], mesh.positions[t[2]]))];
  return sizes;
}

TEST(BuildPartition, PartsOfTheInputMayBeCountedApart) {
  const Mesh mesh = shapes::blob(4, 2);
  const io::MeshSource source(mesh.view(), {0, 0, 0}, "mesh");
  PartitionConfig config;
  config.capacity = 90;
  config.resolution = 4;  // so that cells have too many, and there are rounds
  PartitionBuilder builder(bounds(mesh.view()), config);
  size_t rounds = 0;
  SourceMeasure measure;
  for (; !builder.is_done(); ++rounds) {
    CellCounts counts = builder.empty_counts();
    for (uint64_t at = 0; at < source.triangles(); at += 1000)
      counts.merge(count_cells(source, {}, builder, at,
                               std::min<uint64_t>(at + 1000, source.triangles()),
                               {.measure = rounds == 0 ? &measure : nullptr}));
    builder.advance(counts);
  }
  EXPECT_GT(rounds, 1u);
  EXPECT_EQ(measure.digest, triangle_set_digest(mesh.view()));
  SourceMeasure whole;
  build_partition(source, {}, bounds(mesh.view()), config, &whole);
  EXPECT_EQ(whole.digest, measure.digest);
  EXPECT_EQ(builder.finished().bytes(), partition_of(mesh, config).bytes());
}

TEST(BuildPartition, OnlyACellHasLessThanTwoToThe32Triangles) {
  constexpr uint32_t kMany = 3'000'000'000;
  PartitionConfig config;
  config.capacity = kMany;
  config.resolution = 2;
  PartitionBuilder builder({{0, 0, 0}, {1, 1, 1}}, config);
  CellCounts counts = builder.empty_counts();
  builder.count(counts, {0, 0, 0}, kMany);
  EXPECT_THROW(builder.count(counts, {0, 0, 0}, kMany), Error);
  CellCounts more = counts;
  EXPECT_THROW(more.merge(counts), Error);
  builder.count(counts, {1, 1, 1}, kMany);
  builder.advance(counts);
  EXPECT_EQ(builder.finished().units(), 2u);
}

TEST(BuildPartition, UnitsAreNeitherTooFullNorManyMoreThanNeeded) {
  for (uint32_t resolution : {2u, 16u, 256u}) {
    const Mesh mesh = shapes::terrain(120, 120, 1);
    PartitionConfig config;
    config.capacity = 500;
    config.resolution = resolution;
    const Partition partition = partition_of(mesh, config);
    for (const auto& [leaf, count] : sizes_of(mesh, partition)) {
      EXPECT_LE(count, 500u);
      EXPECT_EQ(partition.unit_count(leaf), 1u);
    }
    EXPECT_LE(partition.units(), 3 * mesh.triangles.size() / 500);
  }
}

TEST(BuildPartition, PlanesMoveFromTierToTier) {
  const Mesh mesh = shapes::terrain(64, 64, 1);
  PartitionConfig config;
  config.capacity = mesh.triangles.size() * 2 / 3 + 100;
  const auto share = [&](uint32_t tier) {
    config.tier = tier;
    const Partition partition = partition_of(mesh, config);
    EXPECT_EQ(partition.units(), 2u);
    return static_cast<double>(sizes_of(mesh, partition).begin()->second) /
           static_cast<double>(mesh.triangles.size());
  };
  EXPECT_NEAR(share(0), 1.0 / 2, 0.05);
  EXPECT_NEAR(share(1), 1.0 / 3, 0.05);
  EXPECT_NEAR(share(2), 1.0 / 2, 0.05);
}

TEST(BuildPartition, TrianglesInOnePlaceAreDealtOutByOrder) {
  Mesh mesh = shapes::soup(1000, 1);
  for (Vec3& p : mesh.positions) p = {4, 5, 6};
  PartitionConfig config;
  config.capacity = 300;
  const Partition partition = partition_of(mesh, config);
  EXPECT_EQ(partition.units(), 4u);
  EXPECT_EQ(partition.shared_leaves(), 1u);
  EXPECT_EQ(partition.home({4, 5, 6}), 0u);
}

TEST(BuildPartition, BytesComeBackAndDamageDoesNoHarm) {
  PartitionConfig config;
  config.capacity = 90;
  config.resolution = 8;
  const Mesh mesh = shapes::blob(4, 2);
  const Partition partition = partition_of(mesh, config);
  const std::vector<std::byte> bytes = partition.bytes();
  EXPECT_EQ(Partition::from_bytes(bytes).bytes(), bytes);
  for (size_t at = 0; at < bytes.size(); ++at) {
    std::vector<std::byte> bad = bytes;
    bad[at] ^= std::byte{0x41};
    try {
      const Partition other = Partition::from_bytes(bad);
      for (const Vec3& p : mesh.positions) EXPECT_LT(other.home(p), other.units());
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::kCorrupt);
    }
  }
  EXPECT_THROW(Partition::from_bytes(std::span(bytes).first(10)), Error);
}

TEST(BuildPartition, NothingIsOneUnit) {
  const Mesh mesh;
  EXPECT_EQ(partition_of(mesh, {}).units(), 1u);
}

}  // namespace
}  // namespace umbel::scale::testing
