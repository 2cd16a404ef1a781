// Assets and residency from C (umbel_asset.h).
#include <algorithm>
#include <limits>
#include <memory>
#include <span>

#include "base/fields.hpp"
#include "base/parallel.hpp"
#include "capi/asset_handle.hpp"
#include "capi/cluster_input.hpp"
#include "capi/geometry.hpp"
#include "capi/hand_out.hpp"
#include "capi/lod_input.hpp"
#include "capi/structs.hpp"
#include "umbel/stream.hpp"

struct umbel_residency {
  const umbel::Asset& asset;
  umbel::Residency residency;
};

struct umbel_page {
  const umbel::Asset& asset;
  std::shared_ptr<const umbel::AssetPage> page;
};

namespace umbel::capi {
namespace {

class CallbackSource : public ByteSource {
 public:
  CallbackSource(uint64_t size, umbel_read read, void* user)
      : size_(size), read_(read), user_(user) {}
  uint64_t size() const override { return size_; }
  void read(uint64_t offset, std::span<std::byte> out) const override {
    if (out.empty() || read_(user_, offset, out.size(), out.data()) == 0) return;
    throw Error(ErrorCode::kIo, "reading " + std::to_string(out.size()) + " bytes at byte " +
                                    std::to_string(offset) + " failed");
  }

 private:
  uint64_t size_;
  umbel_read read_;
  void* user_;
};

// Of all meshes that the page has groups of.
ClusterStreams streams_of(const Asset& asset, const AssetPage& page) {
  ClusterStreams result;
  uint32_t last = kNone;
  for (size_t g = 0; g < page.groups.size(); ++g) {
    if (page.groups[g].mesh == last || page.groups[g].clusters.empty()) continue;
    last = page.groups[g].mesh;
    const lod::ClusterGeometry first = asset.decode(page, g).front();
    result.streams |= streams_in(first);
    const std::vector<Extra> extras = without_material(first.extras);
    if (extras.empty()) continue;
    if (result.extras.empty()) result.extras = extras;
    result.extras_differ |= extras != result.extras;
  }
  return result;
}

void get_geometry(const umbel_page& page, const BuildOptions& options,
                  umbel_lod_geometry* geometry) {
  std::vector<lod::Cluster> clusters;
  std::vector<size_t> first;
  for (const PageGroup& group : page.page->groups) {
    first.push_back(clusters.size());
    clusters.insert(clusters.end(), group.clusters.begin(), group.clusters.end());
  }
  const GeometryArrays arrays(clusters, streams_of(page.asset, *page.page), geometry);
  if (!arrays.need_geometry()) return;
  with_threads(options.threads, [&] {
    parallel_for(first.size(), 1, [&](size_t g) {
      const std::vector<lod::ClusterGeometry> made = page.asset.decode(*page.page, g);
      for (size_t c = 0; c < made.size(); ++c) arrays.write(first[g] + c, made[c], {});
    });
  });
}

std::vector<umbel_page_group> groups_of(const AssetPage& page) {
  std::vector<umbel_page_group> groups;
  uint32_t clusters = 0;
  for (const PageGroup& group : page.groups) {
    const Range& range = group.group.clusters;
    groups.push_back({group.mesh, group.id, range.offset, range.count, clusters});
    clusters += static_cast<uint32_t>(group.clusters.size());
  }
  return groups;
}

StreamView stream_view(const umbel_stream_view* views, size_t index) {
  const umbel_stream_view& given = views[index];
  StreamView view;
  view.mesh = given.mesh;
  view.view = view_of(&given.view);
  const std::string name = "views[" + std::to_string(index) + "].planes";
  const auto planes = elements<const Plane>(given.planes, given.plane_count, name.c_str());
  view.planes.assign(planes.begin(), planes.end());
  return view;
}

umbel_residency_config defaults_of_residency() {
  const ResidencyConfig config;
  umbel_residency_config out{};
  COPY_FIELDS(out, config, threads, budget_bytes, bytes_per_step, loads_in_flight,
              evictions_per_step, groups_per_step, hysteresis, attempts, backoff_seconds,
              slow_seconds);
  return out;
}

ResidencyConfig residency_config(const umbel_residency_config* given) {
  ResidencyConfig config;
  if (!given) return config;
  const umbel_residency_config in = read_struct(given, "config", defaults_of_residency());
  COPY_FIELDS(config, in, loads_in_flight, evictions_per_step, groups_per_step, hysteresis,
              attempts, backoff_seconds, slow_seconds);
  // Half of what a number can be, so that sums of it and of pages are numbers too.
  config.budget_bytes = in.budget_bytes == UMBEL_NO_LIMIT || in.budget_bytes == UMBEL_NONE
                            ? std::numeric_limits<uint64_t>::max() / 2
                            : in.budget_bytes;
  config.bytes_per_step = limit(in.bytes_per_step);
  config.threads = std::max(in.threads, 1u);
  return config;
}

}  // namespace
}  // namespace umbel::capi

using namespace umbel;
using namespace umbel::capi;

umbel_result umbel_asset_open(const char* path, umbel_asset** asset) {
  return hand_out(asset, "asset", [&] {
    return umbel_asset{
        Asset(std::filesystem::path(reinterpret_cast<const char8_t*>(&required(path, "path"))))};
  });
}

umbel_result umbel_asset_open_source(uint64_t size, umbel_read read, void* user,
                                     umbel_asset** asset) {
  return hand_out(asset, "asset", [&] {
    if (!read) throw Error(ErrorCode::kInvalidArgument, "read is NULL");
    return umbel_asset{Asset(std::make_shared<const CallbackSource>(size, read, user))};
  });
}

void umbel_asset_free(umbel_asset* asset) { delete asset; }

umbel_result umbel_asset_get_info(const umbel_asset* asset, umbel_asset_info* info) {
  return guard([&] {
    const Asset& a = required(asset, "asset").asset;
    const AssetInfo& i = a.info();
    umbel_asset_info out{};
    out.version_major = i.version_major;
    out.version_minor = i.version_minor;
    out.pages = i.pages;
    out.meshes = static_cast<uint32_t>(a.meshes().size());
    out.instances = static_cast<uint32_t>(a.instances().size());
    COPY_FIELDS(out, i, max_triangles, max_vertices, file_bytes, header_bytes, checksum,
                source_triangles);
    out.bounds = {{i.bounds.min.x, i.bounds.min.y, i.bounds.min.z},
                  {i.bounds.max.x, i.bounds.max.y, i.bounds.max.z}};
    out.origin = {i.origin.x, i.origin.y, i.origin.z};
    write_struct(out, info, "info");
  });
}

void umbel_residency_config_init_sized(umbel_residency_config* config, size_t size) {
  init_sized(config, size, defaults_of_residency());
}

umbel_result umbel_residency_create(const umbel_asset* asset, const umbel_residency_config* config,
                                    umbel_residency** residency) {
  return hand_out(residency, "residency", [&] {
    const Asset& a = required(asset, "asset").asset;
    return umbel_residency{a, Residency(a, residency_config(config))};
  });
}

void umbel_residency_free(umbel_residency* residency) { delete residency; }

umbel_result umbel_residency_step(umbel_residency* residency, const umbel_stream_view* views,
                                  size_t view_count, double seconds, umbel_stream_step* step) {
  return guard([&] {
    Residency& r = required(residency, "residency").residency;
    struct_size_of(step, "step", sizeof(umbel_stream_step));
    if (view_count > 0) required(views, "views");
    std::vector<StreamView> all;
    for (size_t i = 0; i < view_count; ++i) all.push_back(stream_view(views, i));
    const StreamStep made = r.step(all, seconds);
    const ResidencyStatistics said = r.statistics();
    umbel_stream_step out{};
    COPY_FIELDS(out, made, worst_error, open_groups, missing_groups, loaded, evicted, requested,
                cancelled);
    out.resident_bytes = said.resident_bytes;
    out.failures = said.failures;
    out.evaluated = made.evaluated;
    out.caught_up = made.caught_up;
    write_struct(out, step, "step");
  });
}

umbel_result umbel_residency_cut(const umbel_residency* residency, umbel_stream_cluster* clusters,
                                 size_t capacity, size_t* count) {
  return guard([&] {
    const auto cut = required(residency, "residency").residency.cut();
    required(count, "count") = cut.size();
    if (cut.size() > capacity)
      throw CapacityError{"clusters has room for " + std::to_string(capacity) + ", but there are " +
                          std::to_string(cut.size())};
    for (size_t i = 0; i < cut.size(); ++i)
      (&required(clusters, "clusters"))[i] = {cut[i].view, cut[i].page, cut[i].group,
                                              cut[i].cluster};
  });
}

umbel_result umbel_residency_cluster(const umbel_residency* residency,
                                     const umbel_stream_cluster* cluster,
                                     umbel_cluster_geometry* geometry) {
  return guard([&] {
    const umbel_residency& r = required(residency, "residency");
    const umbel_stream_cluster& c = required(cluster, "cluster");
    umbel_cluster_geometry out = read_struct(geometry, "geometry");
    const auto page = r.residency.page(c.page);
    if (!page || c.group >= page->groups.size() ||
        c.cluster >= page->groups[c.group].clusters.size())
      throw Error(ErrorCode::kInvalidArgument,
                  "the cluster's page is not loaded, or has no such cluster");
    const lod::ClusterGeometry made = r.asset.decode(*page, c.group)[c.cluster];
    out.vertex_count = static_cast<uint32_t>(made.positions.size());
    out.triangle_count = static_cast<uint32_t>(made.triangles.size() / 3);
    out.material = page->groups[c.group].clusters[c.cluster].material;
    const auto as_c = [](const Vec3& v) { return umbel_vec3{v.x, v.y, v.z}; };
    if (out.positions)
      std::transform(made.positions.begin(), made.positions.end(), out.positions, as_c);
    if (out.normals) std::transform(made.normals.begin(), made.normals.end(), out.normals, as_c);
    if (out.triangles) std::copy(made.triangles.begin(), made.triangles.end(), out.triangles);
    write_struct(out, geometry, "geometry");
  });
}

umbel_result umbel_asset_read_page(const umbel_asset* asset, uint32_t number, umbel_page** page) {
  return hand_out(page, "page", [&] {
    const Asset& a = required(asset, "asset").asset;
    return umbel_page{a, std::make_shared<const AssetPage>(a.read_page(number))};
  });
}

umbel_result umbel_residency_get_page(const umbel_residency* residency, uint32_t number,
                                      umbel_page** page) {
  return hand_out(page, "page", [&] {
    const umbel_residency& r = required(residency, "residency");
    const uint32_t pages = r.asset.info().pages;
    std::shared_ptr<const AssetPage> found = number < pages ? r.residency.page(number) : nullptr;
    if (!found)
      throw Error(ErrorCode::kInvalidArgument, "page " + std::to_string(number) + " of " +
                                                   std::to_string(pages) + " is not in memory");
    return umbel_page{r.asset, std::move(found)};
  });
}

void umbel_page_free(umbel_page* page) { delete page; }

umbel_result umbel_page_get_groups(const umbel_page* page, umbel_page_group* groups,
                                   size_t capacity, size_t* count) {
  return guard([&] {
    hand_out_all(groups_of(*required(page, "page").page), groups, "groups", capacity, count);
  });
}

umbel_result umbel_page_get_geometry(const umbel_page* page, const umbel_build_options* options,
                                     umbel_lod_geometry* geometry) {
  return guard([&] { get_geometry(required(page, "page"), build_options(options), geometry); });
}
