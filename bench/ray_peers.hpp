// Tracers to compare with: Embree 4 (any libembree4, opened at run time, by its public C API) and
// tinybvh's BVH8_CPU (where CMake found it).
#pragma once

#include <dlfcn.h>

#include <cstring>
#include <memory>
#include <string>
#include <vector>

#include "tracer.hpp"

#ifdef UMBEL_HAS_TINYBVH
#define TINYBVH_IMPLEMENTATION
#include "tiny_bvh.h"
#endif

namespace bench {

struct EmbreeRayHit {
  float origin[3], t_near, direction[3], time, t_far;
  uint32_t mask, id, flags;
  float normal[3], u, v;
  uint32_t primitive, geometry, instances[6];
};

struct Embree {
  void* (*new_device)(const char*);
  void* (*new_scene)(void*);
  void* (*new_geometry)(void*, int);
  void* (*new_buffer)(void*, int, uint32_t, int, size_t, size_t);
  void (*geometry_quality)(void*, int);
  void (*scene_quality)(void*, int);
  void (*scene_flags)(void*, int);
  void (*commit_geometry)(void*);
  uint32_t (*attach)(void*, void*);
  void (*commit_scene)(void*);
  void (*release_scene)(void*);
  void (*release_geometry)(void*);
  void (*intersect)(void*, EmbreeRayHit*, void*);
  void (*monitor)(void*, bool (*)(void*, ssize_t, bool), void*);
  void* device;
  int64_t memory = 0;
};

template <typename Function>
void find(void* library, const char* name, Function*& function) {
  function = reinterpret_cast<Function*>(dlsym(library, name));
  if (!function) fail(name, "not in Embree's library");
}

inline std::unique_ptr<Embree> open_embree(const std::string& path) {
  void* const library = dlopen(path.c_str(), RTLD_NOW | RTLD_LOCAL);
  if (!library) fail(path, dlerror());
  auto e = std::make_unique<Embree>();
  find(library, "rtcNewDevice", e->new_device);
  find(library, "rtcNewScene", e->new_scene);
  find(library, "rtcNewGeometry", e->new_geometry);
  find(library, "rtcSetNewGeometryBuffer", e->new_buffer);
  find(library, "rtcSetGeometryBuildQuality", e->geometry_quality);
  find(library, "rtcSetSceneBuildQuality", e->scene_quality);
  find(library, "rtcSetSceneFlags", e->scene_flags);
  find(library, "rtcCommitGeometry", e->commit_geometry);
  find(library, "rtcAttachGeometry", e->attach);
  find(library, "rtcCommitScene", e->commit_scene);
  find(library, "rtcReleaseScene", e->release_scene);
  find(library, "rtcReleaseGeometry", e->release_geometry);
  find(library, "rtcIntersect1", e->intersect);
  find(library, "rtcSetDeviceMemoryMonitorFunction", e->monitor);
  e->device = e->new_device("threads=1,set_affinity=0");
  e->monitor(
      e->device,
      [](void* self, ssize_t bytes, bool) {
        static_cast<Embree*>(self)->memory += bytes;
        return true;
      },
      e.get());
  return e;
}

/// `robust`: no ray passes between two triangles that share an edge, which ours promise always.
inline Tracer make_embree(Embree& e, int quality, bool robust, const Mesh& mesh) {
  constexpr const char* kNames[] = {"Embree LOW", "Embree MEDIUM", "Embree HIGH"};
  constexpr int kRobust = 1 << 2;
  constexpr int kTriangles = 0, kIndices = 0, kVertices = 1, kUint3 = 0x5003, kFloat3 = 0x9003;
  const double start = thread_seconds();
  const std::shared_ptr<void> scene(e.new_scene(e.device), e.release_scene);
  void* const geometry = e.new_geometry(e.device, kTriangles);
  // Padded by one vertex, as Embree asks.
  void* const vertices =
      e.new_buffer(geometry, kVertices, 0, kFloat3, 12, mesh.positions.size() + 1);
  void* const indices = e.new_buffer(geometry, kIndices, 0, kUint3, 12, mesh.triangles.size());
  std::memcpy(vertices, mesh.positions.data(), 12 * mesh.positions.size());
  std::memcpy(indices, mesh.triangles.data(), 12 * mesh.triangles.size());
  const int64_t before = e.memory;
  e.geometry_quality(geometry, quality);
  e.scene_quality(scene.get(), quality);
  if (robust) e.scene_flags(scene.get(), kRobust);
  e.commit_geometry(geometry);
  e.attach(scene.get(), geometry);
  e.release_geometry(geometry);
  e.commit_scene(scene.get());
  Tracer tracer;
  tracer.name = std::string(kNames[quality]) + (robust ? ", robust" : "");
  tracer.kind = robust ? Kind::kShown : quality == 2 ? Kind::kSpatialSplits : Kind::kPlain;
  tracer.build_seconds = thread_seconds() - start;
  tracer.bytes_per_triangle =
      static_cast<double>(e.memory - before) / static_cast<double>(mesh.triangles.size());
  tracer.trace = [&e, scene](const std::vector<Ray>& rays, std::vector<Hit>& hits) {
    alignas(64) EmbreeRayHit r{};
    for (size_t i = 0; i < rays.size(); ++i) {
      const Ray& ray = rays[i];
      std::memcpy(r.origin, &ray.origin, 12);
      std::memcpy(r.direction, &ray.direction, 12);
      r.t_near = ray.t_min;
      r.t_far = ray.t_max;
      r.mask = r.geometry = r.primitive = r.instances[0] = umbel::kNone;
      e.intersect(scene.get(), &r, nullptr);
      hits[i] = {r.t_far, r.geometry == umbel::kNone ? umbel::kNone : r.primitive, r.u, r.v};
    }
  };
  return tracer;
}

#ifdef UMBEL_HAS_TINYBVH
inline Tracer make_tinybvh(bool spatial_splits, const Mesh& mesh) {
  const auto corners = std::make_shared<std::vector<tinybvh::bvhvec4>>();
  for (const umbel::Triangle& triangle : mesh.triangles)
    for (const uint32_t vertex : triangle) {
      const Vec3& p = mesh.positions[vertex];
      corners->emplace_back(p.x, p.y, p.z, 0.0f);
    }
  const double start = thread_seconds();
  const auto tree = std::make_shared<tinybvh::BVH8_CPU>();
  const auto count = static_cast<uint32_t>(mesh.triangles.size());
  if (spatial_splits)
    tree->BuildHQ(corners->data(), count);
  else
    tree->Build(corners->data(), count);
  Tracer tracer;
  tracer.name = spatial_splits ? "tinybvh BVH8 HQ" : "tinybvh BVH8";
  tracer.kind = spatial_splits ? Kind::kSpatialSplits : Kind::kPlain;
  tracer.build_seconds = thread_seconds() - start;
  // What its rays touch: nodes and leaves, in blocks of a cache line.
  tracer.bytes_per_triangle = 64.0 * tree->usedBlocks / count;
  tracer.trace = [tree, corners](const std::vector<Ray>& rays, std::vector<Hit>& hits) {
    for (size_t i = 0; i < rays.size(); ++i) {
      const Ray& r = rays[i];
      tinybvh::Ray ray({r.origin.x, r.origin.y, r.origin.z},
                       {r.direction.x, r.direction.y, r.direction.z});
      tree->Intersect(ray);
      const bool is_hit = ray.hit.t < 1e29f;
      hits[i] = {ray.hit.t, is_hit ? ray.hit.prim : umbel::kNone, ray.hit.u, ray.hit.v};
    }
  };
  return tracer;
}
#endif

}  // namespace bench
