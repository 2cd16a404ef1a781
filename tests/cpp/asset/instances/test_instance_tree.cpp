// Trees of instances in files: all instances are in leaves once, and spheres and errors hold.
#include <gtest/gtest.h>

#include <algorithm>

#include "asset/edit_file.hpp"
#include "asset/forest.hpp"
#include "asset/instances/placed_box.hpp"
#include "asset/instances/stand_in.hpp"
#include "asset/instances/tree_file.hpp"
#include "base/math.hpp"

namespace umbel {
namespace {

using testing::forest;
using testing::forest_asset;
using testing::read_bytes;
using testing::Scratch;

using Row = std::pair<uint32_t, std::array<float, 12>>;

std::vector<Row> rows_of(std::span<const Instance> instances) {
  std::vector<Row> rows;
  for (const Instance& instance : instances)
    rows.emplace_back(instance.mesh, instance.transform.rows);
  std::sort(rows.begin(), rows.end());
  return rows;
}

TEST(InstanceTree, has_every_instance_once) {
  const Scratch scratch;
  for (const uint32_t count : {101u, 512u, 513u, 5000u, 20000u}) {
    const Asset asset(forest_asset(scratch, count));
    ASSERT_TRUE(asset.has_instance_tree());
    EXPECT_LE(asset.instances().size(), 64u);
    std::vector<Instance> all;
    for (uint32_t n = 0; n < asset.instance_nodes().size(); ++n) {
      const std::vector<Instance> some = asset.placements(n);
      EXPECT_EQ(some.size(), asset.instance_nodes()[n].placements);
      EXPECT_LE(some.size(), 512u);
      if (asset.instance_nodes()[n].children.count == 0)
        all.insert(all.end(), some.begin(), some.end());
    }
    EXPECT_EQ(asset.instance_nodes()[0].instances, count);
    EXPECT_EQ(rows_of(all), rows_of(forest(count, 2)));
  }
}

TEST(InstanceTree, spheres_contain_and_errors_bound_what_is_below) {
  const Scratch scratch;
  const Asset asset(forest_asset(scratch, 20000));
  const auto& nodes = asset.instance_nodes();
  for (uint32_t n = 0; n < nodes.size(); ++n) {
    for (const Instance& placement : asset.placements(n)) {
      const asset::PlacedBox box(asset.meshes()[placement.mesh].bounds, placement.transform);
      const Vec3d from = to_double(nodes[n].sphere.center);
      EXPECT_LE(length(box.center() - from) + box.radius(), double{nodes[n].sphere.radius});
      EXPECT_LE(asset.instanced_meshes()[placement.mesh].coarsest_error *
                    asset::largest_scale(placement.transform),
                double{nodes[n].coarsest_error});
    }
    for (uint32_t k = 0; k < nodes[n].children.count; ++k) {
      const InstanceNode& child = nodes[nodes[n].children.offset + k];
      EXPECT_LE(child.error, nodes[n].error);
      EXPECT_LE(length(child.sphere.center - nodes[n].sphere.center) + child.sphere.radius,
                nodes[n].sphere.radius);
    }
  }
}

TEST(InstanceTree, has_the_same_bytes_for_any_number_of_threads) {
  const Scratch scratch;
  const lod::Dag sphere = lod::build(shapes::sphere(2).view());
  AssetContents contents;
  contents.meshes = {&sphere};
  contents.instances = forest(9000, 1);
  contents.most_listed_instances = 0;
  write_asset(scratch / "a.umbel", contents, {{}, 1});
  write_asset(scratch / "b.umbel", contents, {{}, 3});
  EXPECT_EQ(read_bytes(scratch / "a.umbel"), read_bytes(scratch / "b.umbel"));
}

TEST(InstanceTree, is_for_many_instances_only) {
  const Scratch scratch;
  const lod::Dag sphere = lod::build(shapes::sphere(2).view());
  AssetContents contents;
  contents.meshes = {&sphere};
  contents.instances = forest(1000, 1);
  write_asset(scratch / "a.umbel", contents);
  const Asset asset(scratch / "a.umbel");
  EXPECT_FALSE(asset.has_instance_tree());
  EXPECT_EQ(asset.instances(), contents.instances);
  EXPECT_TRUE(asset.instance_nodes().empty());
  EXPECT_THROW(InstanceSelector{asset}, Error);
  EXPECT_THROW(asset.placements(0), Error);
}

TEST(InstanceTree, refuses_what_lies_too_far_out) {
  const Scratch scratch;
  const lod::Dag sphere = lod::build(shapes::sphere(2).view());
  AssetContents contents;
  contents.meshes = {&sphere};
  contents.instances = forest(200, 1);
  contents.instances[7].transform.rows = {3e38f, 3e38f, 3e38f, 3e38f, 0, 1, 0, 3e38f, 0, 0, 1, 0};
  contents.most_listed_instances = 100;
  try {
    write_asset(scratch / "a.umbel", contents);
    Asset asset(scratch / "a.umbel");
    asset.instance_nodes();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kInvalidArgument);
    EXPECT_NE(std::string(error.what()).find("instance 7"), std::string::npos);
    return;
  }
  FAIL() << "no error";
}

TEST(InstanceTree, verifies_and_finds_damage) {
  const Scratch scratch;
  const auto path = forest_asset(scratch, 3000);
  EXPECT_TRUE(verify_asset(path, 4).ok);
  const std::vector<char> whole = read_bytes(path);
  // The pages and the nodes are last.
  for (size_t from_end : {size_t{5}, size_t{400}, size_t{20000}, size_t{100000}}) {
    std::vector<char> bytes = whole;
    bytes[bytes.size() - from_end] ^= 16;
    testing::write_bytes(scratch / "b.umbel", bytes);
    EXPECT_FALSE(verify_asset(scratch / "b.umbel", 4).ok) << from_end;
    EXPECT_FALSE(verify_asset_within(size_t{256} << 20, scratch / "b.umbel", 4).ok) << from_end;
  }
}

TEST(InstanceTree, has_at_most_64_levels) {
  constexpr uint64_t kPageBytes = 16 + 52;  // of one placement
  for (const uint32_t levels : {1u, 64u, 65u, 100000u}) {
    asset::StoredInstanceTree tree;
    for (uint32_t n = 0; n < levels; ++n) {
      const Range children = n + 1 < levels ? Range{n + 1, 1} : Range{0, 0};
      tree.nodes.push_back({{{0, 0, 0}, 1}, 0, 0, children, {0, 1}, 1, 1});
      tree.pages.push_back({.offset = n * kPageBytes, .bytes = kPageBytes, .checksum = 0});
    }
    const std::vector<std::byte> bytes = asset::encode_instance_nodes(tree);
    const auto decode = [&] {
      return asset::decode_instance_nodes(bytes, levels, 64, levels * kPageBytes, 1);
    };
    if (levels <= 64)
      EXPECT_EQ(decode().nodes, tree.nodes);
    else
      EXPECT_THROW(decode(), Error);
  }
}

TEST(StandIn, has_the_mean_and_the_spread_of_its_members) {
  const Aabb cube{{-1, -1, -1}, {1, 1, 1}};
  std::vector<asset::Member> members;
  for (int x = 0; x < 4; ++x)
    for (int z = 0; z < 2; ++z)
      members.push_back(asset::member_of({0,
                                          {{1, 0, 0, 2.0f * static_cast<float>(x), 0, 1, 0, 5, 0, 0,
                                            1, 2.0f * static_cast<float>(z)}}},
                                         cube));
  // Cubes side by side make a box of 8 x 2 x 4.
  const asset::Member one = asset::stand_in(members, std::vector<Aabb>{cube}, 0.5);
  const auto& rows = one.instance.transform.rows;
  const std::array<float, 12> box{4, 0, 0, 3, 0, 1, 0, 5, 0, 0, 2, 1};
  for (size_t i = 0; i < 12; ++i) EXPECT_NEAR(rows[i], box[i], 2e-3) << i;
  EXPECT_NEAR(one.thickness, 2, 1e-3);
  EXPECT_LT(one.gap, 0.01);
}

TEST(StandIn, keeps_what_is_much_larger_than_the_rest) {
  const Aabb cube{{-1, -1, -1}, {1, 1, 1}};
  const Instance large{0, {{50, 0, 0, 0, 0, 50, 0, 0, 0, 0, 50, 0}}};
  const std::vector<asset::Member> members{asset::member_of({0, {}}, cube),
                                           asset::member_of(large, cube)};
  EXPECT_EQ(asset::stand_in(members, std::vector<Aabb>{cube}, 0).instance, large);
}

TEST(StandIn, is_not_stretched_across_what_is_flat) {
  const Aabb flat{{-1, 3, -1}, {1, 3, 1}}, line{{-1, 2, 2}, {1, 2, 2}}, point{{1, 1, 1}, {1, 1, 1}};
  for (const Aabb& box : {flat, line, point, Aabb{}}) {
    asset::Member member = asset::member_of({0, {}}, box);
    double apart = 10;
    for (int level = 0; level < 8; ++level, apart *= 2) {
      std::vector<asset::Member> members;
      for (int i = 0; i < 8; ++i) {
        const int x = i % 2, y = i / 2 % 2, z = i / 4;
        Instance moved = member.instance;
        moved.transform.rows[3] += static_cast<float>(x * apart);
        moved.transform.rows[7] += static_cast<float>(y * apart);
        moved.transform.rows[11] += static_cast<float>(z * apart);
        members.push_back(asset::member_of(moved, box));
      }
      member = asset::stand_in(members, std::vector<Aabb>{box}, 0.3);
      // No longer than what it stands for, but for the square root of three.
      EXPECT_LE(asset::largest_scale(member.instance.transform), 2 * apart);
      const Vec3d off = member.box.center() - member.mean;
      EXPECT_LE(length(off), 1e-5 * apart);
    }
  }
}

TEST(InstanceTree, of_meshes_without_triangles_can_be_opened) {
  const Scratch scratch;
  const lod::Dag nothing = lod::build(Mesh{}.view());
  AssetContents contents;
  contents.meshes = {&nothing};
  for (uint32_t i = 0; i < 70000; ++i) {
    contents.instances.push_back({0, {}});
    contents.instances.back().transform.rows[3] = static_cast<float>(i);
  }
  write_asset(scratch / "a.umbel", contents);
  const Asset asset(scratch / "a.umbel");
  EXPECT_TRUE(asset.has_instance_tree());
  EXPECT_TRUE(verify_asset(scratch / "a.umbel", 1).ok);
}

TEST(StandIn, is_finite_for_flat_and_empty_things) {
  const Aabb flat{{-1, 0, -1}, {1, 0, 1}}, point{{0, 0, 0}, {0, 0, 0}};
  for (const Aabb& box : {flat, point, Aabb{}}) {
    std::vector<asset::Member> members;
    for (int i = 0; i < 5; ++i)
      members.push_back(asset::member_of(
          {0, {{1, 0, 0, static_cast<float>(i), 0, 1, 0, static_cast<float>(i * i), 0, 0, 1, 3}}},
          box));
    const asset::Member one = asset::stand_in(members, std::vector<Aabb>{box}, 0.3);
    for (const float f : one.instance.transform.rows) EXPECT_TRUE(std::isfinite(f));
    EXPECT_TRUE(std::isfinite(one.gap) && std::isfinite(one.thickness));
  }
}

}  // namespace
}  // namespace umbel
