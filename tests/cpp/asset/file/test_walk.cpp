// Cuts found page by page are those of selection from tables.
#include <gtest/gtest.h>

#include <map>
#include <set>

#include "asset/scratch.hpp"
#include "base/math.hpp"
#include "lod/synthetic_dag.hpp"
#include "umbel/asset.hpp"

namespace umbel {
namespace {

using lod::testing::Random;
using testing::Scratch;

Asset stored(const Scratch& scratch, const Mesh& mesh, uint32_t page_bytes = 8192) {
  AssetConfig config;
  config.page_bytes = page_bytes;
  write_asset(scratch / "a.umbel", lod::build(mesh.view(), lod::testing::small_config()), "{}", {},
              config);
  return Asset(scratch / "a.umbel");
}

std::vector<Mesh> meshes() {
  return {shapes::blob(5, 1),         shapes::torus(90, 40),   shapes::grid(70, 50),
          shapes::terrain(64, 64, 2), shapes::moebius(300, 8), shapes::fan(2000),
          shapes::soup(2000, 3),      shapes::tetrahedra(600), Mesh{}};
}

std::vector<uint32_t> ids_of(const std::vector<CutCluster>& cut) {
  std::vector<uint32_t> ids;
  for (const CutCluster& cluster : cut) ids.push_back(cluster.id);
  return ids;
}

std::vector<lod::View> views_of(const lod::Tables& tables, Random& random) {
  std::vector<lod::View> views;
  for (uint32_t level = 0; level <= tables.levels.size(); ++level)
    views.push_back(lod::view_level(level));
  views.push_back(lod::view_error(0));
  views.push_back(lod::view_error(std::numeric_limits<float>::infinity()));
  for (int i = 0; i < 20 && !tables.groups.empty(); ++i) {
    const float error = tables.groups[random.below(uint32_t(tables.groups.size()))].error;
    if (std::isfinite(error)) views.push_back(lod::view_error(error));
    views.push_back(lod::testing::random_camera(random, tables, {}));
  }
  return views;
}

TEST(Walk, finds_the_cuts_of_selection) {
  const Scratch scratch;
  Random random(1);
  for (const Mesh& mesh : meshes()) {
    const Asset asset = stored(scratch, mesh);
    const lod::Tables& tables = asset.tables();
    for (const lod::View& view : views_of(tables, random)) {
      WalkReport report;
      const std::vector<uint32_t> found = ids_of(clusters_of_cut(asset, view, 0, {}, &report));
      const std::vector<uint32_t> cut = lod::select(tables, view);
      ASSERT_EQ(found, cut);
      EXPECT_EQ(report.clusters, cut.size());
      EXPECT_EQ(report.error, lod::cut_error(tables, cut));
    }
  }
}

TEST(Walk, leaves_out_what_is_outside_as_selection_does) {
  const Scratch scratch;
  Random random(2);
  for (const Mesh& mesh : {shapes::blob(5, 1), shapes::terrain(64, 64, 2), shapes::soup(2000, 3)}) {
    const Asset asset = stored(scratch, mesh);
    const lod::Tables& tables = asset.tables();
    for (const lod::View& view : views_of(tables, random)) {
      std::vector<Plane> planes;
      for (uint32_t i = random.below(4); i-- > 0;) {
        Vec3 normal = random.point();
        normal = (1.0f / length(normal)) * normal;
        planes.push_back({normal, float(random.between(-1, 1))});
      }
      WalkReport report;
      ASSERT_EQ(ids_of(clusters_of_cut(asset, view, 0, planes, &report)),
                lod::select(tables, view, {planes, {}}));
      EXPECT_LE(report.cut_pages, report.pages);
    }
  }
}

TEST(Walk, makes_the_same_mesh_as_selection) {
  const Scratch scratch;
  for (Mesh mesh : meshes()) {
    for (size_t t = 0; t < mesh.triangles.size(); ++t) mesh.materials.push_back(t > 999);
    const Asset asset = stored(scratch, mesh);
    for (const uint32_t level : {0u, 2u}) {
      const auto cut = clusters_of_cut(asset, lod::view_level(level));
      const Mesh joined = mesh_of_clusters(asset, cut);
      const Mesh known = lod::mesh_of_cut(
          asset.tables(), [&](uint32_t c) { return asset.geometry(c); }, ids_of(cut));
      EXPECT_EQ(joined.positions, known.positions);
      EXPECT_EQ(joined.triangles, known.triangles);
      EXPECT_EQ(joined.materials, known.materials);
    }
  }
}

/// Counts how often each part of a source is read.
class Counting : public ByteSource {
 public:
  explicit Counting(std::shared_ptr<const ByteSource> source) : source_(std::move(source)) {}
  uint64_t size() const override { return source_->size(); }
  void read(uint64_t offset, std::span<std::byte> out) const override {
    ++reads[offset];
    source_->read(offset, out);
  }
  mutable std::map<uint64_t, uint32_t> reads;

 private:
  std::shared_ptr<const ByteSource> source_;
};

TEST(Walk, reads_each_page_once_and_about_twice_those_of_the_cut) {
  const Scratch scratch;
  const Mesh mesh = shapes::blob(7, 1);
  const lod::Dag dag = lod::build(mesh.view());
  AssetConfig config;
  config.page_bytes = 16384;
  write_asset(scratch / "a.umbel", dag, "{}", {}, config);
  const auto counting = std::make_shared<const Counting>(open_file(scratch / "a.umbel"));
  const Asset asset(counting);
  for (uint32_t level = 0; level < dag.tables.levels.size(); ++level) {
    counting->reads.clear();
    const WalkReport report = asset.walk(lod::view_level(level), [](const CutGroup&) {});
    EXPECT_EQ(counting->reads.size(), report.pages);
    for (const auto& [offset, times] : counting->reads) EXPECT_EQ(times, 1u);
    // Half as many again for each level above, and a page for each of these at least.
    EXPECT_LE(report.pages, 2 * report.cut_pages + dag.tables.levels.size()) << "level " << level;
  }
}

TEST(Walk, passes_on_the_visitors_exceptions_and_refuses_what_is_not_there) {
  const Scratch scratch;
  const Asset asset = stored(scratch, shapes::blob(4, 1));
  EXPECT_THROW(asset.walk(lod::view_error(0), [](const CutGroup&) { throw 5; }), int);
  EXPECT_THROW(asset.walk(lod::view_error(0), [](const CutGroup&) {}, 1), Error);
  EXPECT_THROW(asset.walk(lod::view_error(-1), [](const CutGroup&) {}), Error);
  EXPECT_THROW(view_for_triangles(asset, lod::view_level(0), 10), Error);
  EXPECT_THROW(view_for_triangles(asset, lod::view_error(0), 10, std::vector<Instance>{{7}}),
               Error);
}

TEST(ViewForTriangles, is_that_of_the_tables) {
  const Scratch scratch;
  Random random(3);
  for (const Mesh& mesh : meshes()) {
    const Asset asset = stored(scratch, mesh);
    const lod::Tables& tables = asset.tables();
    for (const uint64_t most :
         {uint64_t{1}, uint64_t{100}, uint64_t{1000}, uint64_t{2500}, uint64_t{1} << 40}) {
      EXPECT_EQ(view_for_triangles(asset, lod::view_error(0), most).error,
                lod::error_for_triangles(tables, most));
      if (tables.groups.empty()) continue;
      const lod::View camera = lod::testing::random_camera(random, tables, {});
      const auto costs = lod::triangle_costs(tables);
      EXPECT_EQ(view_for_triangles(asset, camera, most).threshold,
                lod::view_for_budget(tables, camera, costs, most).threshold);
    }
  }
}

TEST(ViewForTriangles, counts_all_instances) {
  const Scratch scratch;
  const Asset asset = stored(scratch, shapes::blob(5, 1));
  const lod::Tables& tables = asset.tables();
  const std::vector<Transform> places{{{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0}},
                                      {{3, 0, 0, 5, 0, 3, 0, 0, 0, 0, 3, 0}},
                                      {{3, 0, 0, 9, 0, 3, 0, 0, 0, 0, 3, 0}},
                                      {{1, 0, 0, 0, 0, 2, 0, 0, 0, 0, 1, 4}}};
  std::vector<Instance> instances;
  for (const Transform& place : places) instances.push_back({0, place});
  for (const uint64_t most : {100u, 3000u, 10000u, 1000000u}) {
    EXPECT_EQ(view_for_triangles(asset, lod::view_error(0), most, instances).error,
              lod::view_for_budget(tables, lod::view_error(0), lod::triangle_costs(tables), most,
                                   {}, places)
                  .error);
    const lod::View camera = lod::testing::camera({0, 0, 4}, 1e-3f);
    EXPECT_EQ(view_for_triangles(asset, camera, most, instances).threshold,
              lod::view_for_budget(tables, camera, lod::triangle_costs(tables), most, {}, places)
                  .threshold);
  }
}

TEST(Summarize, counts_what_the_tables_have) {
  const Scratch scratch;
  const Asset asset = stored(scratch, shapes::blob(5, 1));
  const lod::Tables& tables = asset.tables();
  const MeshSummary summary = summarize(asset).front();
  uint64_t triangles = 0;
  uint32_t most_vertices = 0;
  for (const lod::Cluster& cluster : tables.clusters) {
    triangles += cluster.triangle_count;
    most_vertices = std::max(most_vertices, cluster.vertex_count);
  }
  EXPECT_EQ(summary.triangles, triangles);
  EXPECT_EQ(summary.max_vertices, most_vertices);
  EXPECT_EQ(summary.root_groups, 1u);
}

}  // namespace
}  // namespace umbel
