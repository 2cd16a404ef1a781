// Fuzzes the C interface for devices, on the processor: the bytes become meshes (NaN, infinite and
// huge positions among them), settings, queries, transforms and tables that may be spoilt. Every
// array is exactly as large as the interface asks for. Clusters must be a partition, and answers
// those of the processor's own interface.
#include <algorithm>
#include <array>
#include <cstring>
#include <limits>
#include <memory>
#include <numeric>
#include <vector>

#include "c_interface.hpp"
#include "umbel/umbel_cuda.h"

namespace {

using umbel::fuzz::expect;
using umbel::fuzz::Input;
using umbel::fuzz::went_well;

/// Asks for the size of scratch memory, then calls; false where either is refused.
template <typename Function, typename... Arguments>
bool called(const Function& function, const Arguments&... arguments) {
  alignas(256) static std::byte scratch[256];
  size_t bytes = 0;
  const bool asked = went_well(function(nullptr, &bytes, arguments..., nullptr));
  const bool done = went_well(function(scratch, &bytes, arguments..., nullptr));
  expect(asked == done,
         "the size can be asked for and the call is refused, or the other way around");
  return done;
}

class Triangles {
 public:
  explicit Triangles(Input& in) : floats_a_vertex_(3 + in.below(3)) {
    const uint32_t vertices = 1 + in.below(60);
    positions_.resize(size_t{vertices} * floats_a_vertex_);
    move(in);
    const uint32_t count = in.seldom(16) ? 16 * in.below(200) : in.below(200);
    for (uint32_t i = 0; i < 3 * count; ++i) indices_.push_back(in.below(vertices));
    view = {positions_.data(), 4 * floats_a_vertex_, indices_.data(), nullptr, count};
    if (in.seldom(32)) view.position_stride = in.below(12);
  }

  /// New positions.
  void move(Input& in) {
    for (size_t at = 0; at < positions_.size(); at += floats_a_vertex_) {
      const umbel_vec3 p = in.point();
      std::memcpy(&positions_[at], &p, sizeof p);
    }
  }
  std::vector<umbel_vec3> packed_positions() const {
    std::vector<umbel_vec3> packed(positions_.size() / floats_a_vertex_);
    for (size_t v = 0; v < packed.size(); ++v)
      std::memcpy(&packed[v], &positions_[v * floats_a_vertex_], sizeof packed[v]);
    return packed;
  }

  umbel_cuda_mesh view;

 private:
  size_t floats_a_vertex_;
  std::vector<float> positions_;
  std::vector<uint32_t> indices_;
};

// ---- clusters of frames ------------------------------------------------------------------------

struct Clusters {
  Clusters(uint32_t triangles, uint32_t most)
      : items(triangles),
        indices(3 * size_t{triangles}),
        offsets(size_t{most} + 1),
        boxes(most),
        now(most),
        at_build(most),
        view{items.data(), indices.data(), offsets.data(), boxes.data(), &count},
        growth{now.data(), at_build.data(), total.data()} {}

  void check() const {
    expect(count < offsets.size(), "more clusters than there is room for");
    expect(offsets[count] == items.size(), "clusters do not cover the triangles");
    for (uint32_t c = 0; c < count; ++c)
      expect(offsets[c] < offsets[c + 1], "a cluster without triangles");
    std::vector<uint32_t> sorted = items;
    std::ranges::sort(sorted);
    for (uint32_t i = 0; i < sorted.size(); ++i) expect(sorted[i] == i, "a triangle is lost");
  }

  std::vector<uint32_t> items, indices, offsets;
  std::vector<umbel_aabb> boxes;
  std::vector<uint64_t> now, at_build;
  std::array<uint64_t, 2> total{};
  uint32_t count = 0;
  umbel_cuda_clusters view;
  umbel_cuda_area_growth growth;
};

umbel_frame_config frame_config(Input& in) {
  umbel_frame_config config;
  umbel_frame_config_init(&config);
  config.method = in.below(2);
  config.max_triangles = 2 + in.below(30);
  if (in.likes(2)) config.max_vertices = 3 + in.below(100);
  if (!in.likes(1)) return config;
  uint32_t* const fields[] = {&config.method, &config.max_triangles, &config.min_triangles,
                              &config.max_vertices, &config.code_bits};
  *fields[in.below(std::size(fields))] = in.bytes.integral<uint16_t>();
  config.underfill_cost = in.number();
  return config;
}

void cluster_frames(Input& in) {
  Triangles mesh(in);
  const umbel_frame_config config = frame_config(in);
  const uint32_t triangles = mesh.view.triangles;
  uint32_t most = 0;
  if (!went_well(umbel_frame_max_clusters(triangles, &config, &most))) return;
  expect(most <= triangles, "more clusters than triangles");
  Clusters made(triangles, most);
  if (!called(umbel_cuda_build_frame_clusters, &mesh.view, &config, &made.view)) return;
  made.check();
  called(umbel_cuda_measure_frame_clusters, triangles, &config, &made.view, &made.growth, 1);
  mesh.move(in);
  called(umbel_cuda_refit_frame_clusters, &mesh.view, &config, &made.view, &made.growth);
  std::vector<uint32_t> vertices(3 * size_t{triangles}), first(size_t{most} + 1);
  std::vector<uint8_t> corners(3 * size_t{triangles});
  const umbel_cuda_vertex_lists lists{first.data(), vertices.data(), corners.data()};
  called(umbel_cuda_list_frame_vertices, triangles, &config, &made.view, &lists);
  Clusters again(triangles, most);
  const uint32_t budget = in.seldom(8) ? in.bytes.integral<uint32_t>() : in.below(8);
  if (called(umbel_cuda_rebuild_worst_frame_clusters, &mesh.view, &config, budget, &made.view,
             &made.growth, &again.view, &again.growth))
    again.check();
}

// ---- hierarchies -------------------------------------------------------------------------------

umbel_cuda_bvh_config bvh_config(Input& in) {
  constexpr const char* kBuilders[] = {"lbvh",  "hlbvh",     "atrbvh",    "ploc",
                                       "hploc", "kmeans-q1", "kmeans-q2", "sweep"};
  umbel_cuda_bvh_config config;
  expect(umbel_cuda_bvh_config_init(&config, kBuilders[in.below(8)]) == UMBEL_OK, "no defaults");
  config.max_leaf_size = 1 + in.below(8);
  if (in.likes(2)) config.presplit = static_cast<float>(in.below(9)) / 8;
  if (!in.likes(1)) return config;
  uint32_t* const counts[] = {&config.builder,
                              &config.max_leaf_size,
                              &config.hlbvh_bits,
                              &config.treelet_size,
                              &config.treelet_rounds,
                              &config.ploc_radius,
                              &config.kmeans_clusters,
                              &config.kmeans_candidates,
                              &config.kmeans_iterations,
                              &config.kmeans_manhattan,
                              &config.kmeans_forwarded_clusters};
  float* const numbers[] = {&config.traversal_cost, &config.intersection_cost, &config.presplit};
  for (uint32_t i = in.below(4); i-- > 0;)
    *counts[in.below(std::size(counts))] = in.bytes.integral<uint8_t>();
  if (in.seldom(4)) *numbers[in.below(std::size(numbers))] = in.number();
  return config;
}

struct alignas(16) Aligned {
  std::array<std::byte, 16> bytes;
};

class Tree {
 public:
  Tree(uint32_t nodes, uint32_t triangles)
      : nodes_(5 * size_t{nodes}), triangles_(3 * size_t{triangles}) {
    view = {nodes_.data(), triangles_.data(), &info};
  }
  umbel_cuda_bvh view;
  umbel_compact_info info{};

 private:
  std::vector<Aligned> nodes_, triangles_;
};

/// What the processor's own interface says.
void compare(const Triangles& mesh, const std::vector<umbel_ray>& rays, const std::vector<float>& t,
             const std::vector<uint32_t>& primitives) {
  const std::vector<umbel_vec3> positions = mesh.packed_positions();
  umbel_bvh_mesh same;
  umbel_bvh_mesh_init(&same);
  same.positions = positions.data();
  same.position_count = positions.size();
  same.triangles = mesh.view.indices;
  same.triangle_count = mesh.view.triangles;
  umbel_bvh* bvh = nullptr;
  expect(umbel_bvh_build(&same, nullptr, nullptr, &bvh) == UMBEL_OK, "only devices take a mesh");
  std::vector<umbel_hit> hits(rays.size());
  expect(umbel_bvh_intersect(bvh, rays.data(), rays.size(), nullptr, hits.data()) == UMBEL_OK,
         "only devices take rays");
  umbel_bvh_free(bvh);
  for (size_t i = 0; i < rays.size(); ++i)
    expect(hits[i].primitive == primitives[i] && hits[i].t == t[i], "another hit on a device");
}

void ask(Input& in, const Triangles& mesh, const Tree& tree) {
  std::vector<umbel_ray> rays;
  std::vector<umbel_aabb> boxes;
  for (uint32_t i = in.below(24); i-- > 0;) {
    rays.push_back({in.point(), 0, in.point(), std::numeric_limits<float>::infinity()});
    if (in.likes(3)) rays.back().t_min = in.number(), rays.back().t_max = in.number();
    boxes.push_back({in.point(), in.point()});
  }
  const size_t n = rays.size();
  std::vector<float> t(n), uvs(2 * n), points(3 * n), distances(n);
  std::vector<uint32_t> primitives(n), nearest(n);
  std::vector<uint8_t> flags(n);
  constexpr size_t kStride = sizeof(umbel_ray);
  const umbel_ray* const first = rays.data();
  const umbel_cuda_rays given{n ? &first->origin : nullptr,
                              n ? &first->direction : nullptr,
                              kStride,
                              kStride,
                              n ? &first->t_min : nullptr,
                              n ? &first->t_max : nullptr,
                              kStride,
                              n,
                              0,
                              0,
                              nullptr};
  const umbel_cuda_hits hits{t.data(), primitives.data(), in.likes(4) ? uvs.data() : nullptr};
  expect(called(umbel_cuda_intersect, &tree.view, &given, &hits), "rays are refused");
  expect(called(umbel_cuda_occluded, &tree.view, &given, flags.data()), "rays are refused");
  for (size_t i = 0; i < n; ++i) {
    expect((primitives[i] != UMBEL_NONE) == (flags[i] != 0), "closest and any hit disagree");
    expect(primitives[i] == UMBEL_NONE || primitives[i] < mesh.view.triangles, "a hit of nothing");
  }
  if (in.is_tame()) compare(mesh, rays, t, primitives);
  const umbel_cuda_points around{n ? &first->origin : nullptr, kStride, n, in.number()};
  const umbel_cuda_closest closest{points.data(), distances.data(), nearest.data(), uvs.data()};
  called(umbel_cuda_closest_points, &tree.view, &around, &closest);
  const auto count = static_cast<uint32_t>(n);
  std::vector<uint32_t> offsets(n + 1);
  if (!called(umbel_cuda_count_overlaps, &tree.view, boxes.data(), count, offsets.data())) return;
  const uint32_t room = in.likes(5) ? std::min(in.below(20), offsets[n]) : offsets[n];
  std::vector<uint32_t> found(room);
  called(umbel_cuda_list_overlaps, &tree.view, boxes.data(), count, offsets.data(), found.data(),
         room);
  expect(offsets[n] <= room, "more is listed than there is room for");
  for (uint32_t i = 0; i < offsets[n]; ++i)
    expect(found[i] < mesh.view.triangles, "an overlap of no triangle");
}

void build_and_trace(Input& in) {
  Triangles mesh(in);
  const umbel_cuda_bvh_config config = bvh_config(in);
  uint32_t nodes = 0, triangles = 0;
  if (!went_well(umbel_cuda_bvh_capacity(mesh.view.triangles, &config, &nodes, &triangles))) return;
  Tree tree(nodes, triangles);
  if (!called(umbel_cuda_build_bvh, &mesh.view, &config, &tree.view)) return;
  expect(tree.info.nodes <= nodes && tree.info.triangles <= triangles, "a tree beyond its room");
  ask(in, mesh, tree);
  mesh.move(in);
  expect(called(umbel_cuda_refit_bvh, &mesh.view, &config, &tree.view), "a refit is refused");
  ask(in, mesh, tree);
}

// ---- selection ---------------------------------------------------------------------------------

/// The levels of a wavy grid.
const umbel_lod* wavy_levels() {
  static umbel_lod* const lod = [] {
    constexpr uint32_t kSide = 24;
    std::vector<umbel_vec3> positions;
    std::vector<uint32_t> triangles;
    for (uint32_t i = 0; i < kSide * kSide; ++i) {
      const uint32_t x = i % kSide, y = i / kSide;
      positions.push_back({float(x), float(y), float(x * x * 7 + y * y * 5 + x * y) / 97});
      if (x + 1 == kSide || y + 1 == kSide) continue;
      for (const uint32_t v : {i, i + 1, i + kSide + 1, i, i + kSide + 1, i + kSide})
        triangles.push_back(v);
    }
    umbel_lod_mesh mesh;
    umbel_lod_mesh_init(&mesh);
    mesh.positions = positions.data();
    mesh.position_count = positions.size();
    mesh.triangles = triangles.data();
    mesh.triangle_count = triangles.size() / 3;
    umbel_lod_config config;
    umbel_lod_config_init(&config);
    config.max_triangles = 16;
    config.min_group = 3;
    config.max_group = 6;
    umbel_lod* made = nullptr;
    expect(umbel_lod_build(&mesh, &config, nullptr, &made) == UMBEL_OK, "no levels");
    return made;
  }();
  return lod;
}

/// A copy of an array with a few words overwritten.
template <typename T>
std::vector<T> spoilt(Input& in, const T* from, size_t count) {
  std::vector<T> copy(from, from + count);
  if (!in.likes(6)) return copy;
  for (uint32_t i = in.below(3); i-- > 0 && count > 0;) {
    const uint32_t value = in.bytes.integral<uint32_t>() >> in.below(32);
    const size_t word = in.bytes.integral<uint16_t>() % (sizeof(T) / 4 * count);
    std::memcpy(reinterpret_cast<char*>(copy.data()) + 4 * word, &value, sizeof value);
  }
  return copy;
}

umbel_lod_view any_view(Input& in) {
  umbel_lod_view view{};
  const umbel_vec3 eye = in.point();
  bool made = false;
  switch (in.below(3)) {
    case 0:
      made = went_well(umbel_lod_view_error(in.number(), &view));
      break;
    case 1:
      made = went_well(umbel_lod_view_camera(&eye.x, 1, 1000, 2 + 8 * in.number(), &view));
      break;
    default:
      made = went_well(umbel_lod_view_level(in.below(6), &view));
  }
  if (!made) expect(umbel_lod_view_error(0.01f, &view) == UMBEL_OK, "an ordinary view is refused");
  return view;
}

struct Pages {
  Pages(Input& in, size_t groups) : of_group(groups), states(groups) {
    resident.resize(1 + in.below(20));
    for (uint8_t& r : resident) r = in.below(4) ? 1 : 0;
    for (uint32_t& page : of_group) page = in.below(static_cast<uint32_t>(resident.size()));
    urgencies.resize(resident.size());
    requests.resize(resident.size());
    view = {of_group.data(), resident.data(), states.data(),
            static_cast<uint32_t>(resident.size())};
    feedback = {urgencies.data(), requests.data()};
  }
  std::vector<uint32_t> of_group, states, requests;
  std::vector<uint8_t> resident;
  std::vector<float> urgencies;
  umbel_cuda_pages view;
  umbel_cuda_feedback feedback;
};

void select(Input& in) {
  umbel_lod_arrays given;
  umbel_lod_arrays_init(&given);
  expect(umbel_lod_tables_arrays(umbel_lod_get_tables(wavy_levels()), &given) == UMBEL_OK,
         "tables without arrays");
  const auto levels = spoilt(in, given.levels, given.level_count);
  const auto groups = spoilt(in, given.groups, given.group_count);
  const auto clusters = spoilt(in, given.clusters, given.cluster_count);
  const auto nodes = spoilt(in, given.nodes, given.node_count);
  given.levels = levels.data();
  given.groups = groups.data();
  given.clusters = clusters.data();
  given.nodes = nodes.data();
  uint32_t layers = 0;
  if (!went_well(umbel_cuda_check_tables(&given, &layers))) return;
  const umbel_cuda_tables tables{
      nodes.data(), groups.data(), clusters.data(), nullptr, static_cast<uint32_t>(groups.size()),
      layers};
  const umbel_lod_view view = any_view(in);
  std::vector<umbel_plane> planes(in.below(8));
  for (umbel_plane& p : planes) p = {in.point(), 20 * in.number()};
  std::vector<umbel_transform> instances(in.below(6));
  for (umbel_transform& t : instances) {
    t = {{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0}};
    for (uint32_t i = in.below(5); i-- > 0;) t.rows[in.below(12)] = in.number();
  }
  const auto number = static_cast<uint32_t>(instances.size());
  const umbel_cuda_scene scene{&view, planes.data(), static_cast<uint32_t>(planes.size()),
                               instances.data(), number};
  umbel_cuda_room room{number * static_cast<uint32_t>(nodes.size()),
                       number * static_cast<uint32_t>(groups.size()),
                       number * static_cast<uint32_t>(clusters.size())};
  if (in.likes(7))
    for (uint32_t* size : {&room.queue, &room.groups, &room.clusters})
      if (in.below(3) == 0) *size = in.below(100);
  std::vector<uint32_t> offsets(number + 1), chosen(room.clusters);
  umbel_cuda_counts counts{};
  const umbel_cuda_selection out{offsets.data(), chosen.data(), &counts};
  const bool has_pages = in.likes(5);
  Pages pages(in, groups.size());
  if (has_pages)
    expect(called(umbel_cuda_mark_resident_groups, &tables, levels.data(),
                  static_cast<uint32_t>(levels.size()), &pages.view),
           "pages are refused");
  expect(called(umbel_cuda_select, &tables, &scene, has_pages ? &pages.view : nullptr, &room, &out,
                has_pages ? &pages.feedback : nullptr),
         "a selection is refused");
  expect(std::ranges::is_sorted(offsets) && offsets.back() <= room.clusters,
         "cuts beyond the room");
  for (uint32_t i = 0; i < offsets.back(); ++i)
    expect(chosen[i] < clusters.size(), "a cut of no cluster");
  if (has_pages || counts.overflow || counts.refused) return;
  umbel_lod_tables* same = nullptr;
  expect(umbel_lod_tables_create(&given, &same) == UMBEL_OK, "only devices take tables");
  const umbel_lod_culling culling{planes.data(), planes.size(), nullptr, 0};
  std::vector<uint32_t> expected_offsets(number + 1), expected(room.clusters);
  size_t count = 0;
  if (went_well(umbel_lod_select_instances(same, &view, &culling, instances.data(), number,
                                           expected_offsets.data(), expected.data(),
                                           expected.size(), &count)))
    expect(offsets == expected_offsets &&
               std::equal(chosen.begin(), chosen.begin() + offsets.back(), expected.begin()),
           "another cut on a device");
  umbel_lod_tables_free(same);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  Input in(data, size);
  switch (in.below(3)) {
    case 0:
      cluster_frames(in);
      break;
    case 1:
      build_and_trace(in);
      break;
    default:
      select(in);
  }
  return 0;
}
