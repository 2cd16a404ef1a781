#include "capi/lod_input.hpp"

#include "base/fields.hpp"
#include "capi/structs.hpp"

namespace umbel::capi {
namespace {

// What lod::Config and umbel_lod_config have in common.
#define LOD_CONFIG_FIELDS                                                              \
  max_triangles, max_vertices, min_group, max_group, ratio, position_step, attributes, \
      normal_weight, uv_weight, color_weight, refit_attributes, max_levels, max_error, \
      stop_triangles, measured_error, tangent_weight, skin_weight, mix_materials, keep_area
#define LOD_CLUSTER_FIELDS                                                          \
  lock_borders, min_triangles, underfill_cost, vertex_underfill_cost, overlap_cost, \
      group_underfill_cost, group_overlap_cost

umbel_lod_config config_as_c(const lod::Config& config) {
  umbel_lod_config result{};
  result.struct_size = sizeof result;
  COPY_FIELDS(result, config, LOD_CONFIG_FIELDS);
  COPY_FIELDS(result, config, LOD_CLUSTER_FIELDS);
  result.seams = static_cast<uint32_t>(config.seams);
  result.creases = static_cast<uint32_t>(config.creases);
  return result;
}

umbel_lod_config read(const umbel_lod_config* config) {
  const umbel_lod_config defaults = config_as_c(lod::Config{});
  return config ? read_struct(config, "config", defaults) : defaults;
}

lod::SeamRule seam_rule(uint32_t value, const char* name) {
  if (value > UMBEL_SEAM_IGNORE)
    throw Error(ErrorCode::kInvalidArgument, std::string(name) + " is " + std::to_string(value) +
                                                 ", must be an umbel_seam_rule");
  return static_cast<lod::SeamRule>(value);
}

// Room for the caller's answer, and what it is made of.
class Answer {
 public:
  explicit Answer(const lod::DecimationInput& input) : input_(input) {
    const MeshView& mesh = input.mesh;
    triangles_.resize(mesh.triangles.size());
    const size_t count = mesh.positions.size();
    added_.positions.resize(count);
    if (!mesh.normals.empty()) added_.normals.resize(count);
    if (!mesh.tangents.empty()) added_.tangents.resize(count);
    if (!mesh.uvs.empty()) added_.uvs.resize(count);
    if (!mesh.colors.empty()) added_.colors.resize(count);
    added_.extra_values.resize(count * extra_width(mesh.extras));
    if (!mesh.materials.empty()) materials_.assign(count, mesh.materials.front());
  }

  umbel_lod_decimation question() {
    umbel_lod_decimation group{};
    group.mesh = mesh_as_c(input_.mesh);
    group.locked = input_.locked.data();
    group.target = input_.target;
    group.most = input_.most;
    group.refused_triangle = UMBEL_NONE;
    if (const lod::DecimationRefusal* refused = input_.refused) {
      why_ = to_string(*refused);
      group.refusal = static_cast<uint32_t>(refused->reason);
      group.refused_triangle = refused->triangle;
      group.refused_why = why_.c_str();
      group.refused_edge_count = refused->edges.size();
      if (!refused->edges.empty()) group.refused_edges = refused->edges[0].data();
    }
    group.triangles = triangles_.empty() ? nullptr : triangles_[0].data();
    const auto place = [](auto*& to, auto& stream) {
      to = stream.empty() ? nullptr
                          : reinterpret_cast<std::remove_reference_t<decltype(to)>>(stream.data());
    };
    place(group.added_positions, added_.positions);
    place(group.added_normals, added_.normals);
    place(group.added_tangents, added_.tangents);
    place(group.added_uvs, added_.uvs);
    place(group.added_colors, added_.colors);
    place(group.added_materials, materials_);
    place(group.added_extra_values, added_.extra_values);
    return group;
  }

  void read(const umbel_lod_decimation& group, lod::DecimationResult& result) {
    check(group.triangle_count, triangles_.size(), "triangle_count");
    check(group.added_count, added_.positions.size(), "added_count");
    triangles_.resize(group.triangle_count);
    result.triangles = std::move(triangles_);
    result.error = group.error;
    const auto take = [&](auto& from, auto& to) {
      if (!from.empty()) from.resize(group.added_count);
      to = std::move(from);
    };
    take(added_.positions, result.added.positions);
    take(added_.normals, result.added.normals);
    take(added_.tangents, result.added.tangents);
    take(added_.uvs, result.added.uvs);
    take(added_.colors, result.added.colors);
    take(materials_, result.added_materials);
    added_.extra_values.resize(group.added_count * extra_width(input_.mesh.extras));
    result.added.extra_values = std::move(added_.extra_values);
  }

 private:
  static void check(size_t count, size_t room, const char* name) {
    if (count > room)
      throw Error(ErrorCode::kInvalidArgument,
                  "decimate: " + std::string(name) + " is " + std::to_string(count) +
                      ", but there is room for " + std::to_string(room));
  }

  const lod::DecimationInput& input_;
  std::vector<Triangle> triangles_;
  Mesh added_;
  std::vector<uint32_t> materials_;
  std::string why_;
};

static_assert(uint32_t{UMBEL_LOD_REFUSED_TAKEN_EDGE} ==
              uint32_t(lod::DecimationRefusal::Reason::kTakenEdge));
static_assert(uint32_t{UMBEL_LOD_REFUSED_TURNED_OVER} ==
              uint32_t(lod::DecimationRefusal::Reason::kTurnedOver));

}  // namespace

LodMesh lod_mesh(const umbel_lod_mesh* given) {
  const umbel_lod_mesh mesh = read_struct(given, "mesh");
  LodMesh result;
  MeshView& view = result.view;
  Mesh& copied = result.copied;
  const size_t count = mesh.position_count;
  check_nameable(count, "mesh->position_count");
  check_nameable(mesh.triangle_count, "mesh->triangle_count");
  view.positions =
      strided(mesh.positions, count, mesh.position_stride, "mesh->positions", copied.positions);
  if (!mesh.triangles && mesh.triangle_count > 0)
    throw Error(ErrorCode::kInvalidArgument,
                "mesh->triangles is NULL, but there are " + std::to_string(mesh.triangle_count));
  view.triangles = {reinterpret_cast<const Triangle*>(mesh.triangles), mesh.triangle_count};
  const auto optional = [&](auto& to, const auto* from, size_t stride, const char* name,
                            auto& copies) {
    if (from) to = strided(from, count, stride, name, copies);
  };
  optional(view.normals, mesh.normals, mesh.normal_stride, "mesh->normals", copied.normals);
  optional(view.tangents, mesh.tangents, mesh.tangent_stride, "mesh->tangents", copied.tangents);
  optional(view.uvs, mesh.uvs, mesh.uv_stride, "mesh->uvs", copied.uvs);
  optional(view.colors, mesh.colors, mesh.color_stride, "mesh->colors", copied.colors);
  if (mesh.materials) view.materials = {mesh.materials, mesh.triangle_count};
  if (mesh.locked) result.locked = {mesh.locked, count};
  if (mesh.extra_count > kMostExtraValues)
    throw Error(ErrorCode::kInvalidArgument,
                "mesh->extra_count is " + std::to_string(mesh.extra_count) + ", at most " +
                    std::to_string(kMostExtraValues) + " are possible");
  if (mesh.extra_count > 0) {
    view.extras = elements<const Extra>(mesh.extras, mesh.extra_count, "mesh->extras");
    if (count > 0)
      view.extra_values =
          strided_rows(mesh.extra_values, count, extra_width(view.extras), mesh.extra_stride,
                       "mesh->extra_values", copied.extra_values);
  }
  return result;
}

umbel_lod_mesh mesh_as_c(const MeshView& mesh) {
  umbel_lod_mesh result{};
  result.struct_size = sizeof result;
  const auto place = [](auto*& to, const auto& stream) {
    if (!stream.empty())
      to = reinterpret_cast<std::remove_reference_t<decltype(to)>>(stream.data());
  };
  place(result.positions, mesh.positions);
  place(result.triangles, mesh.triangles);
  place(result.normals, mesh.normals);
  place(result.tangents, mesh.tangents);
  place(result.uvs, mesh.uvs);
  place(result.colors, mesh.colors);
  place(result.materials, mesh.materials);
  place(result.extras, mesh.extras);
  place(result.extra_values, mesh.extra_values);
  result.extra_count = mesh.extras.size();
  result.position_count = mesh.positions.size();
  result.triangle_count = mesh.triangles.size();
  return result;
}

lod::Config lod_config(const umbel_lod_config* given) {
  const umbel_lod_config config = read(given);
  lod::Config result;
  COPY_FIELDS(result, config, LOD_CONFIG_FIELDS);
  COPY_FIELDS(result, config, LOD_CLUSTER_FIELDS);
  result.seams = seam_rule(config.seams, "seams");
  result.creases = seam_rule(config.creases, "creases");
  result.max_triangles = limit(config.max_triangles);
  result.max_vertices = limit(config.max_vertices);
  result.max_levels = limit(config.max_levels);
  return result;
}

lod::Decimator lod_decimator(const umbel_lod_config* given) {
  const umbel_lod_config config = read(given);
  if (!config.decimate) return {};
  return [decimate = config.decimate, user = config.decimate_user](
             const lod::DecimationInput& input, lod::DecimationResult& result) {
    Answer answer(input);
    umbel_lod_decimation group = answer.question();
    const int answered = decimate(&group, user);
    if (answered < 0) throw Error(ErrorCode::kCancelled, "decimate cancelled the build");
    if (answered == 0) return false;
    answer.read(group, result);
    return true;
  };
}

lod::View view_of(const umbel_lod_view* given) {
  const umbel_lod_view& view = required(given, "view");
  if (view.kind > UMBEL_LOD_BY_LEVEL)
    throw Error(ErrorCode::kInvalidArgument,
                "view->kind is " + std::to_string(view.kind) + ", which is no kind of view");
  return {static_cast<lod::View::Kind>(view.kind),
          view.error,
          {view.eye.x, view.eye.y, view.eye.z},
          view.threshold,
          view.level};
}

}  // namespace umbel::capi

void umbel_lod_config_init_sized(umbel_lod_config* config, size_t size) {
  umbel::capi::init_sized(config, size, umbel::capi::read(nullptr));
}
