// Fuzzes the C interface of levels of detail: the bytes become a mesh with any attributes, settings
// and a decimation of the caller's own, and then views, transforms and tables that may be spoilt.
// What is built must be verified, written and read again; all ways to select must give one cut.
#include <algorithm>
#include <cstring>
#include <memory>
#include <set>
#include <utility>
#include <vector>

#include "c_interface.hpp"
#include "scratch.hpp"
#include "umbel/umbel_lod.h"

namespace {

using umbel::fuzz::expect;
using umbel::fuzz::Input;
using umbel::fuzz::scratch;
using umbel::fuzz::went_well;

struct Free {
  void operator()(umbel_lod* lod) const { umbel_lod_free(lod); }
  void operator()(umbel_lod_tables* tables) const { umbel_lod_tables_free(tables); }
  void operator()(umbel_mesh* mesh) const { umbel_mesh_free(mesh); }
};
template <typename T>
using Owned = std::unique_ptr<T, Free>;

class Case : public Input {
 public:
  Case(const uint8_t* data, size_t size) : Input(data, size) {
    read_config();
    read_triangles();
    read_attributes();
    umbel_build_options_init(&options);
    options.threads = config.decimate ? 1 : 1 + below(2);
  }

  umbel_lod_config config;
  umbel_lod_mesh mesh;
  umbel_build_options options;

 private:
  void read_config() {
    umbel_lod_config_init(&config);
    config.max_triangles = 4 + below(30);
    config.max_vertices = 6 + below(30);
    config.min_group = 2 + below(3);
    config.max_group = config.min_group + below(4);
    config.attributes = below(4) ? 1 : 0;
    config.refit_attributes = below(2);
    config.measured_error = seldom(8) ? 1 : 0;
    config.mix_materials = below(2);
    config.keep_area = below(2);
    config.seams = below(3);
    config.creases = below(3);
    if (below(4) == 0) config.position_step = 1.0f / 64;
    if (likes(1)) config.decimate = decimate, config.decimate_user = this;
    if (!likes(2)) return;
    uint32_t* const counts[] = {&config.max_triangles, &config.max_vertices, &config.min_group,
                                &config.max_group,     &config.max_levels,   &config.seams};
    float* const numbers[] = {&config.ratio,       &config.position_step, &config.normal_weight,
                              &config.uv_weight,   &config.color_weight,  &config.tangent_weight,
                              &config.skin_weight, &config.max_error};
    *counts[below(std::size(counts))] = bytes.integral<uint16_t>();
    *numbers[below(std::size(numbers))] = number();
    config.stop_triangles = bytes.integral<uint8_t>();
  }

  /// A piece of a grid, which can be simplified, and triangles of any three vertices.
  void read_triangles() {
    umbel_lod_mesh_init(&mesh);
    const uint32_t columns = below(14), rows = below(14);
    for (uint32_t y = 0; y <= rows; ++y)
      for (uint32_t x = 0; x <= columns; ++x)
        positions_.push_back({float(x) / 8, float(y) / 8, seldom(16) ? number() : 0});
    for (uint32_t i = below(24); i-- > 0;) positions_.push_back(point());
    const auto at = [&](uint32_t x, uint32_t y) { return y * (columns + 1) + x; };
    for (uint32_t y = 0; y < rows; ++y)
      for (uint32_t x = 0; x < columns; ++x)
        for (const uint32_t v :
             {at(x, y), at(x + 1, y), at(x + 1, y + 1), at(x, y), at(x + 1, y + 1), at(x, y + 1)})
          triangles_.push_back(v);
    const auto vertices = static_cast<uint32_t>(positions_.size());
    for (uint32_t i = 3 * below(60); i-- > 0;)
      triangles_.push_back(bytes.integral<uint16_t>() % vertices);
    if (likes(3) && !triangles_.empty())
      triangles_[bytes.integral<uint16_t>() % triangles_.size()] = bytes.integral<uint32_t>();
    mesh.positions = positions_.data();
    mesh.position_count = positions_.size();
    mesh.triangles = triangles_.data();
    mesh.triangle_count = triangles_.size() / 3;
  }

  // From a small set of values, so that vertices are welded and seams are few.
  template <typename Vector, typename Element>
  void read_stream(std::vector<Vector>& stream, const Element*& to) {
    constexpr size_t kWidth = sizeof(Vector) / sizeof(float);
    stream.resize(positions_.size());
    for (Vector& v : stream) {
      float values[kWidth];
      for (float& value : values) value = seldom(8) ? number() : 1;
      std::memcpy(&v, values, sizeof v);
    }
    to = stream.data();
  }

  void read_attributes() {
    if (below(2)) read_stream(normals_, mesh.normals);
    if (below(3) == 0) read_stream(tangents_, mesh.tangents);
    if (below(2)) read_stream(uvs_, mesh.uvs);
    if (below(3) == 0) read_stream(colors_, mesh.colors);
    if (below(2)) {
      for (size_t t = 0; t < mesh.triangle_count; ++t)
        materials_.push_back(below(8) ? 0 : below(3));
      mesh.materials = materials_.data();
    }
    if (likes(4)) read_extras();
  }

  void read_extras() {
    constexpr uint32_t kKinds[] = {UMBEL_EXTRA_UVS, UMBEL_EXTRA_UVS, UMBEL_EXTRA_JOINTS,
                                   UMBEL_EXTRA_WEIGHTS};
    std::set<std::pair<uint32_t, uint32_t>> known;
    size_t width = 0;
    for (uint32_t i = below(8); i-- > 0;) {
      const uint32_t kind = seldom(16) ? bytes.integral<uint32_t>() : kKinds[below(4)];
      const uint32_t set = seldom(16) ? bytes.integral<uint32_t>() : 1 + below(4);
      if (!known.insert({kind, set}).second) continue;
      width += kind == UMBEL_EXTRA_UVS ? 2 : 4;
      extras_.push_back({kind, set});
    }
    if (!likes(5)) {
      extras_.clear();
      for (const auto& [kind, set] : known) extras_.push_back({kind, set});
    }
    extra_values_.resize(width * positions_.size());
    for (float& value : extra_values_) value = seldom(16) ? number() : static_cast<float>(below(3));
    mesh.extras = extras_.data();
    mesh.extra_count = extras_.size();
    mesh.extra_values = extra_values_.data();
  }

  /// Some of the group's triangles, with other corners here and there and a few vertices of its
  /// own.
  static int decimate(umbel_lod_decimation* group, void* user) {
    Case& c = *static_cast<Case*>(user);
    if (c.below(3) == 0) return 0;
    const size_t vertices = group->mesh.position_count;
    const size_t room = group->mesh.triangle_count;
    size_t kept = 0;
    for (size_t t = 0; t < room; ++t) {
      if (c.below(3) == 0) continue;
      for (size_t k = 0; k < 3; ++k)
        group->triangles[3 * kept + k] = group->mesh.triangles[3 * t + k];
      if (c.seldom(16)) group->triangles[3 * kept] = c.bytes.integral<uint16_t>() % (2 * vertices);
      ++kept;
    }
    group->triangle_count = c.seldom(32) ? c.bytes.integral<size_t>() : kept;
    group->added_count = c.seldom(32) ? c.bytes.integral<size_t>() : c.below(4);
    for (size_t i = 0; i < std::min(group->added_count, vertices); ++i)
      group->added_positions[i] = c.point();
    group->error = c.number();
    return 1;
  }

  std::vector<umbel_vec3> positions_, normals_;
  std::vector<umbel_vec4> tangents_, colors_;
  std::vector<umbel_vec2> uvs_;
  std::vector<uint32_t> triangles_, materials_;
  std::vector<umbel_extra> extras_;
  std::vector<float> extra_values_;
};

std::vector<uint32_t> selected(const umbel_lod_tables* tables, const umbel_lod_view& view,
                               const umbel_lod_culling* culling, umbel_lod_method method) {
  size_t count = 0;
  if (!went_well(umbel_lod_select(tables, &view, culling, method, nullptr, 0, &count))) return {};
  std::vector<uint32_t> cut(count);
  expect(umbel_lod_select(tables, &view, culling, method, cut.data(), count, &count) == UMBEL_OK,
         "a cut is refused the second time");
  return cut;
}

umbel_lod_view any_view(Case& c) {
  umbel_lod_view view{};
  const umbel_vec3 eye = c.point();
  const float at[3] = {eye.x, eye.y, eye.z};
  const bool made = went_well(
      c.below(2)   ? umbel_lod_view_error(c.number(), &view)
      : c.below(2) ? umbel_lod_view_camera(at, c.number(), c.below(255), c.number(), &view)
                   : umbel_lod_view_level(c.below(6), &view));
  if (!made) expect(umbel_lod_view_error(0.01f, &view) == UMBEL_OK, "an ordinary view is refused");
  return view;
}

/// Selects from tables, which may be anybody's.
void select(Case& c, const umbel_lod_tables* tables, size_t clusters,
            const std::vector<umbel_cluster_bounds>& normal_cones) {
  const umbel_lod_view view = any_view(c);
  umbel_plane planes[6];
  size_t plane_count = 0;
  const umbel_vec3 from = c.point(), to = c.point(), up = c.point();
  if (!went_well(umbel_lod_frustum(&from.x, &to.x, &up.x, 1, 1.5f, 0.01f, c.number(), planes,
                                   &plane_count)))
    plane_count = 0;
  const umbel_lod_culling culling{planes, plane_count, normal_cones.data(), normal_cones.size()};
  const umbel_lod_culling* const culled = c.below(2) ? &culling : nullptr;
  const auto cut = selected(tables, view, culled, UMBEL_LOD_FLAT);
  for (const uint32_t cluster : cut) expect(cluster < clusters, "a cut of no cluster");
  std::vector<umbel_transform> instances(c.below(4));
  for (umbel_transform& t : instances) {
    t = {{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0}};
    for (uint32_t i = c.below(4); i-- > 0;) t.rows[c.below(12)] = c.number();
  }
  std::vector<uint32_t> offsets(instances.size() + 1), chosen(instances.size() * clusters);
  size_t count = 0;
  went_well(umbel_lod_select_instances(tables, &view, culled, instances.data(), instances.size(),
                                       offsets.data(), chosen.data(), chosen.size(), &count));
  umbel_lod_view affordable;
  umbel_lod_budget budget;
  umbel_lod_budget_init(&budget);
  budget.unit = c.below(4);
  budget.limit = c.bytes.integral<uint16_t>();
  went_well(umbel_lod_view_for_budget(tables, &view, &budget, culled, instances.data(),
                                      instances.size(), &affordable));
  offsets.resize(std::max<size_t>(offsets.size(), 2));
  went_well(umbel_lod_select_for_budget(tables, &view, &budget, culled, instances.data(),
                                        instances.size(), offsets.data(), chosen.data(),
                                        chosen.size(), &count, nullptr));
}

/// A copy of the tables with a few words of it overwritten.
void spoil_tables(Case& c, const umbel_lod_arrays& arrays) {
  const auto copied = [&]<typename T>(const T* from, size_t count) {
    std::vector<T> copy(from, from + count);
    for (uint32_t i = c.below(3); i-- > 0 && count > 0;) {
      const uint32_t value = c.bytes.integral<uint32_t>() >> c.below(32);
      const size_t word = c.bytes.integral<uint16_t>() % (sizeof(T) / 4 * count);
      std::memcpy(reinterpret_cast<char*>(copy.data()) + 4 * word, &value, sizeof value);
    }
    return copy;
  };
  const auto levels = copied(arrays.levels, arrays.level_count);
  const auto groups = copied(arrays.groups, arrays.group_count);
  const auto clusters = copied(arrays.clusters, arrays.cluster_count);
  const auto nodes = copied(arrays.nodes, arrays.node_count);
  umbel_lod_arrays spoilt = arrays;
  spoilt.levels = levels.data();
  spoilt.groups = groups.data();
  spoilt.clusters = clusters.data();
  spoilt.nodes = nodes.data();
  umbel_lod_tables* made = nullptr;
  if (!went_well(umbel_lod_tables_create(&spoilt, &made))) return;
  const Owned<umbel_lod_tables> tables(made);
  select(c, made, clusters.size(), {});
}

umbel_lod_arrays arrays_of(const umbel_lod_tables* tables) {
  umbel_lod_arrays arrays;
  umbel_lod_arrays_init(&arrays);
  expect(umbel_lod_tables_arrays(tables, &arrays) == UMBEL_OK, "tables without arrays");
  return arrays;
}

Owned<umbel_mesh> mesh_of_cut(const umbel_lod* lod, const std::vector<uint32_t>& cut,
                              umbel_lod_mesh& arrays) {
  umbel_mesh* mesh = nullptr;
  umbel_lod_mesh_init(&arrays);
  expect(umbel_lod_mesh_of_cut(lod, cut.data(), cut.size(), &mesh) == UMBEL_OK &&
             umbel_mesh_arrays(mesh, &arrays) == UMBEL_OK,
         "a cut is no mesh");
  return Owned<umbel_mesh>(mesh);
}

void check_cuts(Case& c, const umbel_lod* lod) {
  const umbel_lod_tables* tables = umbel_lod_get_tables(lod);
  const umbel_lod_view view = any_view(c);
  const auto cut = selected(tables, view, nullptr, UMBEL_LOD_FLAT);
  expect(cut == selected(tables, view, nullptr, UMBEL_LOD_HIERARCHY) &&
             cut == selected(tables, view, nullptr, UMBEL_LOD_BREADTH_FIRST),
         "two ways give different cuts");
  umbel_lod_mesh arrays;
  mesh_of_cut(lod, cut, arrays);
  const std::vector<uint32_t> any{c.below(255), c.below(255)};
  umbel_mesh* mesh = nullptr;
  went_well(umbel_lod_mesh_of_cut(lod, any.data(), any.size(), &mesh));
  umbel_mesh_free(mesh);
}

void write_and_read(Case& c, const umbel_lod* lod, size_t clusters) {
  if (!went_well(umbel_lod_save(lod, scratch().c_str(), c.below(2) ? 1 : 0, &c.options))) return;
  umbel_lod_tables* tables = nullptr;
  expect(umbel_lod_tables_open(scratch().c_str(), &tables) == UMBEL_OK,
         "what was written cannot be read");
  const Owned<umbel_lod_tables> owner(tables);
  expect(arrays_of(tables).cluster_count == clusters, "clusters were lost in a file");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  Case c(data, size);
  umbel_lod* made = nullptr;
  const bool ok = went_well(umbel_lod_build(&c.mesh, &c.config, &c.options, &made));
  expect(ok == (made != nullptr), "success without levels, or the other way around");
  if (!ok) return 0;
  const Owned<umbel_lod> lod(made);
  umbel_lod_report report;
  umbel_lod_report_init(&report);
  expect(umbel_lod_get_report(made, &report) == UMBEL_OK, "no report");
  const umbel_result verified = umbel_lod_verify(made, 3, 1, &c.options);
  if (c.is_tame()) expect(verified == UMBEL_OK, "verification failed");
  check_cuts(c, made);
  const umbel_lod_arrays arrays = arrays_of(umbel_lod_get_tables(made));
  std::vector<umbel_cluster_bounds> normal_cones(arrays.cluster_count);
  expect(umbel_lod_normal_cones(made, &c.options, normal_cones.data(), normal_cones.size()) ==
             UMBEL_OK,
         "clusters without cones");
  select(c, umbel_lod_get_tables(made), arrays.cluster_count, normal_cones);
  spoil_tables(c, arrays);
  if (size % 4 == 0) write_and_read(c, made, arrays.cluster_count);
  return 0;
}
