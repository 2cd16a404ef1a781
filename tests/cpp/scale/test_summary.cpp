#include <gtest/gtest.h>

#include "scale/summary.hpp"
#include "scale/units.hpp"

namespace umbel::scale::testing {
namespace {

TEST(Summary, PartsMergeToTheWhole) {
  const Mesh mesh = rich(shapes::blob(3, 1));
  const io::MeshSource source(mesh.view(), {0, 0, 0}, "mesh");
  const SourceSummary whole = summarise(source, 0, source.triangles());
  SourceSummary merged;
  for (uint64_t at = 0; at < source.triangles(); at += 100)
    merged.merge(summarise(source, at, std::min<uint64_t>(at + 100, source.triangles())));
  EXPECT_EQ(merged.fingerprint, whole.fingerprint);
  EXPECT_EQ(merged.triangles, mesh.triangles.size());
  EXPECT_EQ(box_of(merged, {}), bounds(mesh.view()));
}

TEST(Summary, TheFingerprintKnowsEveryValueAndTheOrder) {
  const Mesh mesh = rich(shapes::blob(2, 1));
  const auto print = [](const Mesh& m) {
    const io::MeshSource source(m.view(), {0, 0, 0}, "mesh");
    return summarise(source, 0, source.triangles()).fingerprint;
  };
  const uint64_t same = print(mesh);
  Mesh other = mesh;
  other.positions[5].y += 0.001f;
  EXPECT_NE(print(other), same);
  other = mesh;
  other.uvs[5].y += 0.001f;
  EXPECT_NE(print(other), same);
  other = mesh;
  other.extra_values[5] += 0.001f;
  EXPECT_NE(print(other), same);
  other = mesh;
  other.materials[5] ^= 1;
  EXPECT_NE(print(other), same);
  other = mesh;
  std::swap(other.triangles[3], other.triangles[9]);
  EXPECT_NE(print(other), same);
}

TEST(Summary, TheOriginIsNearWhatLiesFarAway) {
  SourceSummary summary;
  summary.triangles = 1;
  summary.exact = false;
  summary.low = {500'000.25, 5'400'000.5, 10};
  summary.high = {501'000.25, 5'400'900.5, 20};
  const Vec3d origin = choose_origin(summary);
  EXPECT_EQ(origin.x, 500'736.0);  // a multiple of 512
  EXPECT_EQ(std::fmod(origin.y, 512.0), 0.0);
  summary.exact = true;
  EXPECT_EQ(choose_origin(summary), (Vec3d{0, 0, 0}));
  summary.exact = false;
  summary.low = {-1, -1, -1};
  summary.high = {1, 1, 1.1};
  EXPECT_EQ(choose_origin(summary), (Vec3d{0, 0, 0}));
}

}  // namespace
}  // namespace umbel::scale::testing
