// Fuzzes a file of a structure over triangles: any file must be refused with a sentence, or give a
// structure whose queries stay within its arrays and come to an end.
#pragma once

#include <array>

#include "container_bytes.hpp"
#include "umbel/mesh.hpp"
#include "umbel/triangle_queries.hpp"

namespace umbel::fuzz {

inline void check_hit(const TriangleQueries& tree, const Hit& hit) {
  if (hit.hit() && hit.primitive >= tree.triangle_count()) fail("a hit of no triangle");
}

inline void ask_rays(const TriangleQueries& tree, const Vec3& p, const Vec3& d) {
  const Ray ray{p, 0, d};
  const Hit hit = tree.intersect(ray);
  check_hit(tree, hit);
  if (tree.occluded(ray) != hit.hit()) fail("closest and any hit disagree");
  std::array<Hit, 5> hits;
  const size_t count = tree.all_hits(ray, hits);
  if ((count > 0) != hit.hit()) fail("closest and all hits disagree");
  for (size_t i = 0; i < count; ++i) check_hit(tree, hits[i]);
  const ClosestPoint closest = tree.closest_point(p);
  if (closest.primitive != kNone && closest.primitive >= tree.triangle_count())
    fail("a closest point on no triangle");
  tree.contains(p);
  for (const uint32_t primitive : tree.overlaps(Sphere{p, 0.25f}))
    if (primitive >= tree.triangle_count()) fail("an overlap of no triangle");
  tree.overlaps(Aabb{{p.x - 0.5f, p.y - 0.5f, p.z - 0.5f}, p});
}

inline void ask_everything(const TriangleQueries& tree) {
  const Aabb box = tree.bounds();
  ask_rays(tree, {0, 0, 0}, {1, 0, 0});
  ask_rays(tree, {0.1f, 0.2f, 0.3f}, {-0.5f, 0.25f, 1});
  ask_rays(tree, box.min, {box.max.x - box.min.x, box.max.y - box.min.y, box.max.z - box.min.z});
  ask_rays(tree, box.max, {0, -1, 0});
}

/// The files of a few meshes, each built with each config.
template <typename Structure, typename Config>
std::vector<Bytes> make_seeds(const std::vector<Config>& configs) {
  std::vector<Bytes> seeds;
  for (const Mesh& mesh : {shapes::sphere(1), shapes::soup(20, 1), Mesh{}})
    for (const Config& config : configs) {
      std::vector<uint32_t> masks;
      if (config.compact) masks.assign(mesh.triangles.size(), 5);
      Structure::build(mesh.view(), config, masks).save(scratch());
      seeds.push_back(read_file());
    }
  return seeds;
}

/// Reads a file made of the fuzzer's bytes and a seed, its checksums repaired, and asks.
template <typename Tree, typename Ask>
void read_and_ask(const std::vector<Bytes>& seeds, const uint8_t* data, size_t size,
                  const Ask& ask) {
  Bytes bytes = file_of(seeds, data, size);
  repair_checksums(bytes);
  write_file(bytes);
  try {
    Tree tree = Tree::load(scratch());
    ask(tree);
  } catch (const Error& error) {
    if (error.what()[0] == '\0') fail("an error without a sentence");
  }
}

}  // namespace umbel::fuzz
