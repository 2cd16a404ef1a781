#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <map>
#include <set>
#include <string>

#include "heap_peak.hpp"
#include "io/source/table_source.hpp"
#include "scale/route.hpp"
#include "scale/route_file.hpp"
#include "scale/units.hpp"

namespace umbel::scale::testing {
namespace {

using Corner = std::array<float, 3>;
using Corners = std::array<Corner, 3>;

Corners corners_of(const Mesh& mesh, size_t triangle) {
  Corners corners;
  for (size_t k = 0; k < 3; ++k) {
    const Vec3& p = mesh.positions[mesh.triangles[triangle][k]];
    corners[k] = {p.x, p.y, p.z};
  }
  return corners;
}

struct Case {
  const char* name;
  Mesh mesh;
};

std::vector<Case> cases() {
  Mesh point = shapes::soup(300, 5);
  for (Vec3& p : point.positions) p = {1, 2, 3};
  Mesh heap = shapes::soup(900, 3);  // all but a few in one place, by their middle
  for (size_t i = 0; i < 800; ++i)
    for (size_t k = 0; k < 3; ++k) {
      const float a = static_cast<float>(k) * 2.0943951f;
      heap.positions[heap.triangles[i][k]] = {std::cos(a), std::sin(a), 0};
    }
  Mesh flat = shapes::grid(40, 40);
  return {{"blob", shapes::blob(4, 1)},
          {"soup", shapes::soup(3000, 2)},
          {"terrain", rich(shapes::terrain(50, 40, 3))},
          {"fan", shapes::fan(2000)},
          {"point", point},
          {"heap", rich(heap)},
          {"flat", flat},
          {"tetrahedra", shapes::tetrahedra(200)},
          {"one", shapes::soup(1, 1)}};
}

TEST(Route, EveryTriangleIsInOneUnitInOrderAndNoUnitIsTooFull) {
  for (const Case& c : cases()) {
    const Units all = all_units(c.mesh, 100, 700);
    std::multiset<Corners> wanted, found;
    std::map<Corners, size_t> place;
    for (size_t i = 0; i < c.mesh.triangles.size(); ++i) {
      wanted.insert(corners_of(c.mesh, i));
      place[corners_of(c.mesh, i)] = i;
    }
    for (const UnitInput& unit : all.units) {
      EXPECT_LE(unit.mesh.triangles.size(), 100u) << c.name;
      validate(unit.mesh.view());
      size_t last = 0;
      for (size_t i = 0; i < unit.mesh.triangles.size(); ++i) {
        const Corners corners = corners_of(unit.mesh, i);
        found.insert(corners);
        if (wanted.count(corners) > 1) continue;
        EXPECT_GE(place[corners], last) << c.name;
        last = place[corners];
      }
    }
    EXPECT_EQ(wanted, found) << c.name;
  }
}

TEST(Route, AttributesAndMaterialsComeAlong) {
  const Mesh mesh = rich(shapes::terrain(50, 40, 3));
  std::map<Corners, size_t> place;
  for (size_t i = 0; i < mesh.triangles.size(); ++i) place[corners_of(mesh, i)] = i;
  for (const UnitInput& unit : all_units(mesh, 100, 700).units)
    for (size_t i = 0; i < unit.mesh.triangles.size(); ++i) {
      const size_t from = place.at(corners_of(unit.mesh, i));
      EXPECT_EQ(unit.mesh.materials[i], mesh.materials[from]);
      for (size_t k = 0; k < 3; ++k) {
        const uint32_t a = unit.mesh.triangles[i][k], b = mesh.triangles[from][k];
        EXPECT_EQ(unit.mesh.uvs[a], mesh.uvs[b]);
        EXPECT_EQ(unit.mesh.colors[a], mesh.colors[b]);
        EXPECT_EQ(unit.mesh.normals[a], mesh.normals[b]);
        EXPECT_EQ(unit.mesh.extra_values[2 * a], mesh.extra_values[2 * b]);
      }
    }
}

TEST(Route, WhatTwoUnitsShareIsFrozenInBothAndNotAllIs) {
  for (const Case& c : cases()) {
    const Units all = all_units(c.mesh, 100, 700);
    std::map<Corner, std::set<size_t>> users;
    for (size_t u = 0; u < all.units.size(); ++u)
      for (const Vec3& p : all.units[u].mesh.positions) users[{p.x, p.y, p.z}].insert(u);
    size_t frozen = 0, shared = 0;
    for (const UnitInput& unit : all.units) {
      std::map<Corner, uint8_t> seen;
      for (size_t v = 0; v < unit.frozen.size(); ++v) {
        const Vec3& p = unit.mesh.positions[v];
        const Corner corner{p.x, p.y, p.z};
        if (users[corner].size() > 1) {
          EXPECT_EQ(unit.frozen[v], 1) << c.name;
          ++shared;
        }
        const auto [at, is_new] = seen.emplace(corner, unit.frozen[v]);
        EXPECT_EQ(at->second, unit.frozen[v]) << c.name;
        frozen += unit.frozen[v];
      }
    }
    if (std::string(c.name) == "blob" || std::string(c.name) == "terrain")
      EXPECT_LT(frozen, shared * 3 / 2) << c.name;
  }
}

TEST(Route, UnitsDoNotDependOnHowTheSourceIsTakenApart) {
  for (const Case& c : cases()) {
    const Units all = all_units(c.mesh, 100, 1u << 20);
    for (uint64_t shard : {333u, 1000u}) {
      const Units other = all_units(c.mesh, 100, shard);
      ASSERT_EQ(all.partition.bytes(), other.partition.bytes());
      for (size_t u = 0; u < all.units.size(); ++u) {
        const Mesh &a = all.units[u].mesh, &b = other.units[u].mesh;
        EXPECT_EQ(a.positions, b.positions) << c.name;
        EXPECT_EQ(a.triangles, b.triangles) << c.name;
        EXPECT_EQ(a.uvs, b.uvs) << c.name;
        EXPECT_EQ(a.materials, b.materials) << c.name;
        EXPECT_EQ(all.units[u].frozen, other.units[u].frozen) << c.name;
      }
    }
  }
}

TEST(Route, OneUnitIsTheWeldedMesh) {
  const Mesh mesh = rich(shapes::terrain(50, 40, 3));
  const Units all = all_units(mesh, 1u << 20, 777);
  ASSERT_EQ(all.units.size(), 1u);
  const Mesh welded = weld(mesh.view());
  EXPECT_EQ(all.units[0].mesh.positions, welded.positions);
  EXPECT_EQ(all.units[0].mesh.triangles, welded.triangles);
  EXPECT_EQ(all.units[0].mesh.extra_values, welded.extra_values);
  EXPECT_EQ(all.units[0].frozen, std::vector<uint8_t>(welded.positions.size(), 0));
  EXPECT_EQ(all.box, bounds(mesh.view()));
}

TEST(Route, ADamagedFileIsRefused) {
  const umbel::testing::Scratch scratch;
  const Mesh mesh = shapes::blob(3, 1);
  const io::MeshSource source(mesh.view(), {0, 0, 0}, "mesh");
  PartitionConfig config;
  config.capacity = 200;
  const Aabb box = bounds(mesh.view());
  const Partition partition = build_partition(source, {}, box, config);
  const auto path = route(source, partition, {{}, 200}, scratch / ".").front();
  const std::vector<char> good = umbel::testing::read_bytes(path);
  for (size_t at = 0; at < good.size(); at += 1 + good.size() / 97) {
    std::vector<char> bad = good;
    bad[at] = static_cast<char>(bad[at] ^ 8);
    umbel::testing::write_bytes(path, bad);
    bool refused = false;
    try {
      for (uint32_t u = 0; u < partition.units(); ++u)
        read_unit({path}, partition, source.streams(), box, u);
    } catch (const Error& error) {
      refused = error.code() == ErrorCode::kCorrupt;
    }
    // Some bytes of the header are never used.
    EXPECT_TRUE(refused || (at >= 48 && at < 64)) << at;
  }
  umbel::testing::write_bytes(path, {good.begin(), good.begin() + 50});
  EXPECT_THROW(RouteFile{path}, Error);
}

TEST(Route, MemoryDoesNotGrowWithTheSource) {
  if (!umbel::testing::HeapPeak::counts()) GTEST_SKIP();
  const auto peak = [](uint32_t side) {
    const umbel::testing::Scratch scratch;
    const Mesh mesh = shapes::terrain(side, 256, 1);
    const io::MeshSource source(mesh.view(), {0, 0, 0}, "mesh");
    const Aabb box = bounds(mesh.view());
    PartitionConfig config;
    config.capacity = 20'000;
    const Partition partition = build_partition(source, {}, box, config);
    const umbel::testing::HeapPeak heap;
    route(source, partition, {{}, config.capacity}, scratch / ".", 1u << 16);
    return heap.bytes();
  };
  EXPECT_LT(peak(2048), peak(512) * 5 / 4);
}

}  // namespace
}  // namespace umbel::scale::testing
