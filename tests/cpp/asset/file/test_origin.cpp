// The sections that may be absent: the origin, and the scene.
#include <gtest/gtest.h>

#include <bit>
#include <limits>

#include "asset/edit_file.hpp"
#include "asset/scratch.hpp"
#include "umbel/asset.hpp"

namespace umbel {
namespace {

using testing::entry_of;
using testing::failure_of;
using testing::get;
using testing::kSections;
using testing::put;
using testing::repair_checksums;
using testing::Scratch;
using testing::small_asset;
using testing::write_bytes;

constexpr Vec3d kEarth{4027893.75, 307045.5, -4919474.125};
constexpr size_t kOriginSection = kSections, kSceneSection = kSections + 1;

std::optional<ErrorCode> failure_of_bytes(const Scratch& scratch, std::vector<char> bytes) {
  repair_checksums(bytes);
  write_bytes(scratch / "b.umbel", bytes);
  return failure_of(scratch / "b.umbel");
}

TEST(AssetOrigin, comes_back_to_the_bit_with_the_scene) {
  const Scratch scratch;
  small_asset(scratch, kEarth, "{\"nodes\": []}");
  const Asset asset(scratch / "whole.umbel");
  EXPECT_EQ(asset.info().origin, kEarth);
  EXPECT_EQ(asset.scene(), "{\"nodes\": []}");
  EXPECT_EQ(failure_of(scratch / "whole.umbel"), std::nullopt);
}

TEST(AssetOrigin, takes_no_byte_where_it_is_zero) {
  const Scratch scratch;
  const std::vector<char> plain = small_asset(scratch);
  EXPECT_EQ(get(plain, 40, 4), kSections);
  EXPECT_EQ(small_asset(scratch, {-0.0, 0, -0.0}), plain);
  const Asset asset(scratch / "whole.umbel");
  EXPECT_EQ(asset.info().origin, Vec3d{});
  EXPECT_EQ(asset.scene(), "");
}

TEST(AssetOrigin, an_empty_section_is_none) {
  const Scratch scratch;
  std::vector<char> bytes = small_asset(scratch, kEarth, "{}");
  for (const size_t section : {kOriginSection, kSceneSection}) {
    put(bytes, entry_of(bytes, section) + 16, 8, 0);
    put(bytes, entry_of(bytes, section) + 24, 8, 0);
  }
  EXPECT_EQ(failure_of_bytes(scratch, bytes), std::nullopt);
  const Asset asset(scratch / "b.umbel");
  EXPECT_EQ(asset.info().origin, Vec3d{});
  EXPECT_EQ(asset.scene(), "");
}

TEST(AssetOrigin, that_is_not_finite_is_neither_read_nor_written) {
  const Scratch scratch;
  const std::vector<char> whole = small_asset(scratch, kEarth);
  const size_t at = get(whole, entry_of(whole, kOriginSection) + 8, 8);
  for (const double wrong :
       {std::numeric_limits<double>::quiet_NaN(), -std::numeric_limits<double>::infinity()}) {
    for (size_t axis = 0; axis < 3; ++axis) {
      std::vector<char> bytes = whole;
      put(bytes, at + 8 * axis, 8, std::bit_cast<uint64_t>(wrong));
      EXPECT_EQ(failure_of_bytes(scratch, bytes), ErrorCode::kCorrupt);
    }
    EXPECT_THROW(small_asset(scratch, {0, wrong, 0}), Error);
  }
}

TEST(AssetOrigin, sections_of_wrong_sizes_are_refused_and_longer_elements_stepped_over) {
  const Scratch scratch;
  const std::vector<char> whole = small_asset(scratch, kEarth, "{\"extras\": \"of some length\"}");
  const size_t entry = entry_of(whole, kOriginSection);
  // Elements that are too short, more than one of them, and one that leaves the file header.
  std::vector<char> bytes = whole;
  put(bytes, entry + 4, 4, 12);
  put(bytes, entry + 24, 8, 2);
  EXPECT_EQ(failure_of_bytes(scratch, bytes), ErrorCode::kCorrupt);
  bytes = whole;
  put(bytes, entry + 16, 8, 48);
  put(bytes, entry + 24, 8, 2);
  EXPECT_EQ(failure_of_bytes(scratch, bytes), ErrorCode::kCorrupt);
  bytes = whole;
  put(bytes, entry + 8, 8, get(bytes, 24, 8) - 8);
  EXPECT_EQ(failure_of_bytes(scratch, bytes), ErrorCode::kCorrupt);
  bytes = whole;
  put(bytes, entry_of(bytes, kSceneSection) + 16, 8, 5);
  EXPECT_EQ(failure_of_bytes(scratch, bytes), ErrorCode::kCorrupt);
  // A newer version's longer element: what follows here is the scene's first bytes.
  bytes = whole;
  put(bytes, entry + 4, 4, 32);
  put(bytes, entry + 16, 8, 32);
  EXPECT_EQ(failure_of_bytes(scratch, bytes), std::nullopt);
  EXPECT_EQ(Asset(scratch / "b.umbel").info().origin, kEarth);
}

TEST(AssetOrigin, a_point_is_subtracted_before_it_is_rounded) {
  const Vec3 local = relative_to(kEarth, {kEarth.x + 0.125, kEarth.y - 1e-4, kEarth.z});
  EXPECT_EQ(local.x, 0.125f);
  EXPECT_NEAR(local.y, -1e-4f, 1e-9f);
  EXPECT_EQ(local.z, 0.0f);
  const lod::View here = lod::view_camera({0.125f, 0, 2}, 1.0f, 1000, 1.0f);
  const lod::View there =
      lod::view_camera({kEarth.x + 0.125, kEarth.y, kEarth.z + 2}, kEarth, 1.0f, 1000, 1.0f);
  EXPECT_EQ(there.eye, here.eye);
  EXPECT_EQ(there.threshold, here.threshold);
}

}  // namespace
}  // namespace umbel
