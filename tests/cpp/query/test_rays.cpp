#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "base/math.hpp"
#include "bvh/real_meshes.hpp"

namespace umbel {
namespace {

using namespace testing;

struct Named {
  std::string name;
  Mesh mesh;
};

Mesh doubled(Mesh mesh) {
  const std::vector<Triangle> once = mesh.triangles;
  for (const Triangle& t : once) mesh.triangles.push_back({t[0], t[2], t[1]});
  return mesh;
}

/// A triangle, segments and points in one mesh.
Mesh degenerate() {
  Mesh mesh = shapes::grid(3, 3);
  mesh.triangles.push_back({0, 0, 0});
  mesh.triangles.push_back({0, 5, 0});
  mesh.triangles.push_back({1, 2, 3});  // on one line
  return mesh;
}

std::vector<Named> small_meshes() {
  return {{"sphere", shapes::sphere(2)},
          {"torus", shapes::torus(14, 9)},
          {"soup", shapes::soup(300, 1)},
          {"grid", shapes::grid(9, 7)},
          {"fan", shapes::fan(60)},
          {"blob, far away", transformed(shapes::blob(2, 3), 1, {1000, -2000, 500})},
          {"moebius", shapes::moebius(30, 3)},
          {"doubled", doubled(shapes::sphere(1))},
          {"degenerate", degenerate()},
          {"one triangle", shapes::soup(1, 5)}};
}

std::string described(const BvhConfig& c) {
  return std::string(bvh::name(c.tree.builder)) + ", width " + std::to_string(c.width) +
         (c.compact ? ", compact" : "") + ", simd " + std::to_string(static_cast<int>(c.simd));
}

/// Every builder, width, instruction set, compact and not.
std::vector<BvhConfig> all_configs() {
  std::vector<BvhConfig> all;
  const std::vector<Simd> paths = simd_paths();
  for (const bvh::Builder builder : bvh::builders())
    for (const uint32_t width : {2u, 4u, 8u})
      for (const Simd simd : paths)
        for (const bool compact : {false, true}) {
          BvhConfig config;
          config.tree = bvh::Config{};
          config.tree.builder = builder;
          config.width = width, config.simd = simd, config.compact = compact;
          all.push_back(config);
        }
  return all;
}

void expect_right_hits(const Bvh& tree, const MeshView& mesh, const std::vector<Ray>& rays,
                       const std::vector<Truth>& truths, const std::string& what) {
  for (size_t i = 0; i < rays.size(); ++i) {
    const Hit hit = tree.intersect(rays[i]);
    ASSERT_TRUE(is_right(mesh, rays[i], truths[i], hit)) << what << ", ray " << i;
    ASSERT_EQ(tree.occluded(rays[i]), hit.hit()) << what << ", ray " << i;
  }
}

std::vector<Truth> truths_of(const MeshView& mesh, const std::vector<Ray>& rays) {
  std::vector<Truth> truths;
  for (const Ray& ray : rays) truths.push_back(trace_all(mesh, ray));
  return truths;
}

TEST(BvhOracle, closest_and_any_hits_of_every_tree_equal_brute_force) {
  const std::vector<BvhConfig> configs = all_configs();
  for (const Named& named : small_meshes()) {
    const MeshView mesh = named.mesh.view();
    const std::vector<Ray> rays = adversarial_rays(mesh, 280, 11);
    const std::vector<Truth> truths = truths_of(mesh, rays);
    // Of the rays that are aimed at something, most meet it: the comparison is not idle.
    for (const BvhConfig& config : configs)
      expect_right_hits(Bvh::build(mesh, config), mesh, rays, truths,
                        named.name + ", " + described(config));
  }
}

/// Triangles without area, as far as floats can tell, on a few lines.
Mesh without_area() {
  Mesh mesh;
  std::mt19937 random(9);
  std::uniform_real_distribution<float> unit(-1, 1);
  for (int line = 0; line < 4; ++line) {
    const Vec3 along{unit(random), unit(random), unit(random)};
    for (uint32_t i = 0; i < 90; ++i) {
      const float s = unit(random);
      if (i % 3 == 2) {
        const auto n = static_cast<uint32_t>(mesh.positions.size());
        mesh.triangles.push_back({n - 2, n - 1, n});
      }
      mesh.positions.push_back({along.x * s, along.y * s, along.z * s});
    }
  }
  return mesh;
}

TEST(BvhOracle, which_tree_is_asked_makes_no_difference) {
  std::vector<Named> meshes = small_meshes();
  meshes.push_back({"without area", without_area()});
  const std::vector<BvhConfig> configs = all_configs();
  for (const Named& named : meshes) {
    const MeshView mesh = named.mesh.view();
    const std::vector<Ray> rays = adversarial_rays(mesh, 420, 16);
    const Bvh first = Bvh::build(mesh);
    std::vector<Hit> hits;
    for (const Ray& ray : rays) hits.push_back(first.intersect(ray));
    for (const BvhConfig& config : configs) {
      const Bvh tree = Bvh::build(mesh, config);
      for (size_t i = 0; i < rays.size(); ++i)
        ASSERT_EQ(tree.intersect(rays[i]), hits[i])
            << named.name << ", " << described(config) << ", ray " << i;
    }
  }
}

TEST(BvhOracle, every_instruction_set_gives_the_same_bits) {
  for (const Named& named : small_meshes()) {
    const MeshView mesh = named.mesh.view();
    const std::vector<Ray> rays = adversarial_rays(mesh, 280, 12);
    for (const uint32_t width : {2u, 4u, 8u})
      for (const bool compact : {false, true}) {
        BvhConfig config;
        config.width = width, config.compact = compact, config.simd = Simd::kPortable;
        const Bvh portable = Bvh::build(mesh, config);
        for (const Simd simd : simd_paths()) {
          config.simd = simd;
          const Bvh other = Bvh::build(mesh, config);
          for (size_t i = 0; i < rays.size(); ++i)
            ASSERT_EQ(portable.intersect(rays[i]), other.intersect(rays[i]))
                << named.name << ", " << described(config) << ", ray " << i;
        }
      }
  }
}

/// Rays through surfaces at a distance of zero, backwards, and within intervals that end at -0.
std::vector<Ray> rays_about_their_origin(const MeshView& mesh) {
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  constexpr float kIntervals[][2] = {
      {-kInfinity, kInfinity}, {-kInfinity, 0}, {-kInfinity, -0.0f}, {-0.0f, kInfinity}, {-0.0f, 0},
      {-0.0f, -0.0f},          {0, -0.0f},      {-1, -0.01f},        {-0.5f, 0.5f}};
  std::vector<Ray> rays = adversarial_rays(mesh, 90, 17);
  for (size_t i = 0; i < rays.size(); ++i) {
    if (i % 2 == 0) {
      const Triangle& triangle = mesh.triangles[i * 7 % mesh.triangles.size()];
      const Vec3 &a = mesh.positions[triangle[0]], &b = mesh.positions[triangle[1]];
      rays[i].origin = i % 4 == 0 ? a : (a + b) * 0.5f;
    }
    rays[i].t_min = kIntervals[i % std::size(kIntervals)][0];
    rays[i].t_max = kIntervals[i % std::size(kIntervals)][1];
  }
  return rays;
}

TEST(BvhOracle, negative_distances_and_zeros_of_either_sign_are_right_everywhere) {
  size_t behind = 0, at_zero = 0;
  for (const Named& named : small_meshes()) {
    const MeshView mesh = named.mesh.view();
    const std::vector<Ray> rays = rays_about_their_origin(mesh);
    const std::vector<Truth> truths = truths_of(mesh, rays);
    std::vector<Hit> hits;
    for (const BvhConfig& config : all_configs()) {
      if (config.tree.builder != bvh::builders()[0]) continue;
      const Bvh tree = Bvh::build(mesh, config);
      expect_right_hits(tree, mesh, rays, truths, named.name + ", " + described(config));
      for (size_t i = 0; i < rays.size(); ++i) {
        const Hit hit = tree.intersect(rays[i]);
        if (hits.size() == i) hits.push_back(hit);
        ASSERT_EQ(hit, hits[i]) << named.name << ", " << described(config) << ", ray " << i;
      }
    }
    for (const Hit& hit : hits) {
      behind += hit.hit() && hit.t < 0;
      at_zero += hit.hit() && hit.t == 0;
    }
  }
  EXPECT_GT(behind, 50u);
  EXPECT_GT(at_zero, 20u);
}

TEST(BvhOracle, rays_that_are_aimed_at_a_mesh_find_it) {
  const Mesh sphere = shapes::sphere(2);
  size_t found = 0;
  const std::vector<Ray> rays = adversarial_rays(sphere.view(), 700, 13);
  const Bvh tree = Bvh::build(sphere.view());
  for (const Ray& ray : rays) found += tree.intersect(ray).hit();
  EXPECT_GT(found, 350u);
}

TEST(BvhOracle, all_hits_are_the_triangles_on_the_ray_in_order) {
  for (const Named& named : small_meshes()) {
    const MeshView mesh = named.mesh.view();
    for (const uint32_t width : {2u, 4u, 8u}) {
      BvhConfig config;
      config.width = width, config.compact = width == 4;
      const Bvh tree = Bvh::build(mesh, config);
      const std::vector<Ray> rays = adversarial_rays(mesh, 140, 14);
      for (size_t r = 0; r < rays.size(); ++r) {
        const Ray& ray = rays[r];
        std::vector<Hit> hits(mesh.triangles.size() + 1);
        hits.resize(tree.all_hits(ray, hits));
        std::set<uint32_t> met;
        for (size_t i = 0; i < hits.size(); ++i) {
          ASSERT_TRUE(met.insert(hits[i].primitive).second);
          if (i > 0) {
            ASSERT_LE(hits[i - 1].t, hits[i].t);
          }
        }
        for (uint32_t i = 0; i < mesh.triangles.size(); ++i) {
          const Triangle& t = mesh.triangles[i];
          const Crossing x =
              cross_triangle(ray, mesh.positions[t[0]], mesh.positions[t[1]], mesh.positions[t[2]]);
          if (met.contains(i)) {
            ASSERT_TRUE(x.is_possible) << named.name;
          } else {
            ASSERT_FALSE(x.is_certain && x.t - x.tolerance > ray.t_min &&
                         x.t + x.tolerance < ray.t_max)
                << named.name << ", ray " << r << " misses " << i;
          }
        }
        ASSERT_EQ(tree.intersect(ray), hits.empty() ? Hit{} : hits[0]);
        // With room for fewer, the nearest.
        std::vector<Hit> two(2);
        two.resize(tree.all_hits(ray, two));
        ASSERT_EQ(two.size(), std::min<size_t>(2, hits.size()));
        ASSERT_TRUE(std::equal(two.begin(), two.end(), hits.begin()));
      }
    }
  }
}

TEST(BvhOracle, batches_equal_single_rays) {
  const Mesh mesh = shapes::blob(3, 1);
  const Bvh tree = Bvh::build(mesh.view());
  const std::vector<Ray> rays = adversarial_rays(mesh.view(), 3000, 15);
  std::vector<Hit> hits(rays.size());
  std::vector<uint8_t> occluded(rays.size());
  tree.intersect(rays, hits);
  tree.occluded(rays, occluded);
  for (size_t i = 0; i < rays.size(); ++i) {
    EXPECT_EQ(hits[i], tree.intersect(rays[i]));
    EXPECT_EQ(occluded[i] != 0, hits[i].hit());
  }
}

// ---- real meshes --------------------------------------------------------------------------------

const char* const kRealMeshes[] = {"armadillo_86k.ply",
                                   "bunny_69k.ply",
                                   "cad_brick_housing_24k.ply",
                                   "cad_gears_19k.ply",
                                   "dragon_11k_res4.ply",
                                   "gargo_50k_normals_colors.ply",
                                   "sibenik_75k.ply",
                                   "nasty_boeing_2k.ply",
                                   "nasty_bunny_dup_16k.ply",
                                   "nasty_capsule_10k.ply",
                                   "nasty_chair_13k.ply",
                                   "nasty_conrod_soup_6k.ply",
                                   "nasty_cycloidal_43k.ply",
                                   "nasty_mpi_180.ply",
                                   "nasty_office_chair_7k.ply",
                                   "nasty_synth_all_degenerate.ply",
                                   "nasty_synth_bowtie_vertex.ply",
                                   "nasty_synth_book_edge.ply",
                                   "nasty_synth_moebius.ply",
                                   "nasty_synth_klein_bottle.ply",
                                   "nasty_synth_dup_flipped.ply",
                                   "nasty_synth_t_junctions.ply",
                                   "nasty_synth_fan_50k.ply",
                                   "nasty_synth_needles_20k.ply",
                                   "nasty_synth_same_centroid_20k.ply",
                                   "nasty_synth_identical_10k.ply",
                                   "nasty_synth_components_10k.ply",
                                   "nasty_synth_isolated_vertices.ply",
                                   "nasty_synth_single_triangle.ply",
                                   "nasty_synth_dragon_ecef_f32.ply",
                                   "nasty_synth_dragon_tiny.ply",
                                   "nasty_synth_dragon_scale_1e15.ply",
                                   "nasty_tetfaces_96k.ply",
                                   "nasty_trumpet_24k.ply"};

TEST(BvhOracle, hits_on_real_meshes_equal_brute_force) {
  for_real_meshes(kRealMeshes, [](const char* name, const Mesh& mesh) {
    const std::vector<Ray> rays = adversarial_rays(mesh.view(), 28, 21);
    const std::vector<Truth> truths = truths_of(mesh.view(), rays);
    for (const uint32_t width : {2u, 4u, 8u})
      for (const bool compact : {false, true}) {
        BvhConfig config;
        config.width = width, config.compact = compact;
        expect_right_hits(Bvh::build(mesh.view(), config), mesh.view(), rays, truths,
                          std::string(name) + ", " + described(config));
      }
  });
}

TEST(BvhOracle, hits_on_large_meshes_equal_brute_force) {
  constexpr const char* names[] = {"dragon_871k.ply", "conference_331k.ply", "bench_arch_329k.ply",
                                   "bench_scan_1111k.ply"};
  for_real_meshes(names, [](const char* name, const Mesh& mesh) {
    const std::vector<Ray> rays = adversarial_rays(mesh.view(), 14, 22);
    expect_right_hits(Bvh::build(mesh.view()), mesh.view(), rays, truths_of(mesh.view(), rays),
                      name);
  });
}

TEST(BvhOracle, every_builder_takes_every_nasty_mesh) {
  size_t read = 0;
  for (const char* name : kRealMeshes) {
    if (!std::string(name).starts_with("nasty_synth")) continue;
    const auto mesh = read_mesh(name);
    if (!mesh) continue;
    ++read;
    const std::vector<Ray> rays = adversarial_rays(mesh->view(), 14, 23);
    const std::vector<Truth> truths = truths_of(mesh->view(), rays);
    for (const bvh::Builder builder : bvh::builders()) {
      BvhConfig config;
      config.tree = bvh::Config{};
      config.tree.builder = builder;
      expect_right_hits(Bvh::build(mesh->view(), config), mesh->view(), rays, truths,
                        std::string(name) + ", " + described(config));
    }
  }
  if (read == 0) GTEST_SKIP() << "no meshes";
}

// ---- watertightness -----------------------------------------------------------------------------

/// From points inside at every vertex and the middle of every edge: all must hit.
void expect_no_leak(const Mesh& mesh, const Vec3& inside, const std::string& what) {
  for (const BvhConfig& config : all_configs()) {
    if (config.tree.builder != bvh::Builder::kBinned) continue;
    const Bvh tree = Bvh::build(mesh.view(), config);
    const auto expect_hit = [&](const Vec3& at) {
      const Ray ray{inside, 0, {at.x - inside.x, at.y - inside.y, at.z - inside.z}};
      ASSERT_TRUE(tree.intersect(ray).hit()) << what << ", " << described(config);
      ASSERT_TRUE(tree.occluded(ray)) << what << ", " << described(config);
    };
    for (const Triangle& t : mesh.triangles)
      for (int k = 0; k < 3; ++k) {
        const Vec3 &a = mesh.positions[t[k]], &b = mesh.positions[t[(k + 1) % 3]];
        expect_hit(a);
        expect_hit({a.x * 0.5f + b.x * 0.5f, a.y * 0.5f + b.y * 0.5f, a.z * 0.5f + b.z * 0.5f});
      }
  }
}

TEST(BvhOracle, no_ray_passes_between_triangles_at_any_scale) {
  for (int power = -15; power <= 15; power += 3) {
    const auto scale = static_cast<float>(std::pow(10.0, power));
    const std::string what = "scale 1e" + std::to_string(power);
    const auto moved = [&](const Mesh& mesh, const Vec3& by) {
      return transformed(mesh, scale, {by.x * scale, by.y * scale, by.z * scale});
    };
    expect_no_leak(moved(shapes::sphere(2), {0, 0, 0}), {0, 0, 0}, what);
    expect_no_leak(moved(shapes::sphere(2), {7, -5, 3}),
                   {7.1f * scale, -5.2f * scale, 3.05f * scale}, what + ", moved");
    expect_no_leak(moved(shapes::blob(2, 7), {0, 0, 0}),
                   {0.01f * scale, 0.02f * scale, 0.03f * scale}, what + ", blob");
    expect_no_leak(moved(shapes::torus(16, 12), {0, 0, 0}), {scale, 0, 0}, what + ", torus");
  }
}

TEST(BvhOracle, rays_along_axes_hit_flat_triangles_of_every_size) {
  for (const BvhConfig& config : all_configs()) {
    if (config.tree.builder != bvh::Builder::kBinned) continue;
    for (int power = -27; power <= 37; ++power) {
      const auto s = static_cast<float>(std::pow(10.0, power));
      Mesh mesh;
      mesh.positions = {{-s, -s, 0}, {2 * s, -s, 0}, {-s, 2 * s, 0}};
      mesh.triangles = {{0, 1, 2}};
      const Bvh tree = Bvh::build(mesh.view(), config);
      for (const float x : {-0.4f, 0.1f, 0.3f})
        for (const float length : {1.0f, 1e8f}) {
          const Hit hit = tree.intersect({{x * s, 0.2f * s, s}, 0, {0, 0, -length}});
          ASSERT_TRUE(hit.hit()) << described(config) << ", size 1e" << power;
          ASSERT_NEAR(hit.t / s * length, 1, 1e-5) << described(config) << ", size 1e" << power;
        }
    }
  }
}

TEST(BvhOracle, origins_and_directions_may_be_any_finite_ones) {
  Mesh mesh;
  mesh.positions = {
      {1.1e38f, 1.1e38f, 2e38f}, {1.5e38f, 1.1e38f, 2e38f}, {1.1e38f, 1.5e38f, 2e38f}};
  mesh.triangles = {{0, 1, 2}};
  for (const BvhConfig& config : all_configs()) {
    if (config.tree.builder != bvh::Builder::kBinned) continue;
    const Bvh tree = Bvh::build(mesh.view(), config);
    const Vec3 origin{1.2e38f, 1.2e38f, 1.1e38f};
    const Hit slow = tree.intersect({origin, 0, {0, 0, 1}});
    const Hit fast = tree.intersect({origin, 0, {0, 0, 3e38f}});
    ASSERT_TRUE(slow.hit() && fast.hit()) << described(config);
    EXPECT_NEAR(slow.t / 9e37f, 1, 1e-5);
    EXPECT_NEAR(fast.t, 0.3, 1e-5);
  }
}

TEST(BvhOracle, what_lies_at_a_t_that_overflows_is_missed) {
  const Mesh mesh = shapes::sphere(2);
  const std::vector<Ray> missing = rays_whose_t_overflows();
  const Ray near_the_end{{0.01f, 0.02f, -3}, 0, {0, 0, 8e-39f}};  // beyond it for the far side
  for (const BvhConfig& config : all_configs()) {
    if (config.tree.builder != bvh::Builder::kBinned) continue;
    const Bvh tree = Bvh::build(mesh.view(), config);
    std::vector<Hit> hits(9);
    for (const Ray& ray : missing) {
      EXPECT_EQ(tree.intersect(ray), Hit{}) << described(config);
      EXPECT_FALSE(tree.occluded(ray)) << described(config);
      EXPECT_EQ(tree.all_hits(ray, hits), 0u) << described(config);
    }
    EXPECT_NEAR(tree.intersect(near_the_end).t / 2.5e38f, 1, 0.02) << described(config);
    EXPECT_TRUE(tree.occluded(near_the_end)) << described(config);
    EXPECT_EQ(tree.all_hits(near_the_end, hits), 1u) << described(config);
  }
}

// ---- what has no answer -------------------------------------------------------------------------

TEST(BvhOracle, empty_meshes_answer_every_query) {
  std::vector<Bvh> trees;
  trees.emplace_back();
  for (const bvh::Builder builder : bvh::builders()) {
    BvhConfig config;
    config.tree = bvh::Config{};
    config.tree.builder = builder;
    trees.push_back(Bvh::build(MeshView{}, config));
  }
  for (Bvh& tree : trees) {
    const Ray ray{{0, 0, 0}, 0, {1, 0, 0}};
    EXPECT_FALSE(tree.intersect(ray).hit());
    EXPECT_FALSE(tree.occluded(ray));
    std::vector<Hit> hits(3);
    EXPECT_EQ(tree.all_hits(ray, hits), 0u);
    EXPECT_EQ(tree.closest_point(Vec3{1, 2, 3}).primitive, kNone);
    EXPECT_FALSE(tree.contains(Vec3{0, 0, 0}));
    EXPECT_EQ(tree.signed_distance(Vec3{0, 0, 0}), std::numeric_limits<float>::infinity());
    EXPECT_TRUE(tree.overlaps(Aabb{{-1, -1, -1}, {1, 1, 1}}).empty());
    EXPECT_TRUE(tree.overlaps(Sphere{{0, 0, 0}, 1}).empty());
    EXPECT_TRUE(tree.overlaps(Frustum{}).empty());
    EXPECT_FALSE(tree.refit(MeshView{}).rebuild_advised);
    EXPECT_EQ(tree.statistics().nodes, 0u);
    EXPECT_EQ(tree.triangle_count(), 0u);
  }
}

TEST(BvhOracle, rays_that_are_none_hit_nothing) {
  const Mesh mesh = shapes::sphere(2);
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  for (const BvhConfig& config : all_configs()) {
    if (config.tree.builder != bvh::builders()[0]) continue;
    const Bvh tree = Bvh::build(mesh.view(), config);
    const Ray rays[] = {{{kNan, 0, 0}, 0, {1, 0, 0}},     {{0, 0, 0}, 0, {1, kNan, 0}},
                        {{0, 0, 0}, 0, {0, 0, 0}},        {{0, 0, 0}, 2, {1, 0, 0}, 1},
                        {{0, 0, 0}, kNan, {1, 0, 0}},     {{0, 0, 0}, 0, {1, 0, 0}, kNan},
                        {{0, 0, 0}, 0, {-0.0f, 0, -0.0f}}};
    for (const Ray& ray : rays) {
      EXPECT_FALSE(tree.intersect(ray).hit());
      EXPECT_FALSE(tree.occluded(ray));
    }
  }
}

TEST(BvhOracle, triangles_that_are_not_finite_are_refused_or_dropped) {
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  Mesh mesh = shapes::sphere(2);
  mesh.positions[5].y = kNan;
  mesh.positions[17].x = std::numeric_limits<float>::infinity();
  const Mesh kept = drop_invalid(mesh.view()).mesh;
  const std::vector<Ray> rays = adversarial_rays(kept.view(), 100, 31);
  for (const bvh::Builder builder : bvh::builders()) {
    BvhConfig config;
    config.tree = bvh::Config{};
    config.tree.builder = builder;
    EXPECT_THROW(Bvh::build(mesh.view(), config), Error);
    config.tree.invalid = bvh::InvalidTriangles::kDrop;
    const Bvh tree = Bvh::build(mesh.view(), config);
    const Bvh whole = Bvh::build(kept.view(), config);
    EXPECT_EQ(tree.triangle_count(), mesh.triangles.size());
    for (const Ray& ray : rays) EXPECT_EQ(tree.intersect(ray).t, whole.intersect(ray).t);
    mesh.triangles[3][1] = 100000;
    EXPECT_THROW(Bvh::build(mesh.view(), config), Error);
    mesh.triangles[3][1] = shapes::sphere(2).triangles[3][1];
  }
}

}  // namespace
}  // namespace umbel
