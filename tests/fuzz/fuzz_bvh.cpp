// Fuzzes the reading of .umbvh files and the queries on what was read: the bytes are a file, whose
// checksums are repaired so that what lies behind them is reached. Any file must be refused with a
// sentence, or give a tree whose queries stay within its arrays and come to an end.
#include <array>

#include "container_bytes.hpp"
#include "umbel/triangle_bvh.hpp"

namespace {

using umbel::TriangleBvh;
using umbel::Vec3;
using umbel::fuzz::Bytes;
using umbel::fuzz::fail;

void check_hit(const TriangleBvh& tree, const umbel::Hit& hit) {
  if (hit.hit() && hit.primitive >= tree.triangle_count()) fail("a hit of no triangle");
}

void ask(const TriangleBvh& tree, const Vec3& p, const Vec3& d) {
  const umbel::Ray ray{p, 0, d};
  const umbel::Hit hit = tree.intersect(ray);
  check_hit(tree, hit);
  if (tree.occluded(ray) != hit.hit()) fail("closest and any hit disagree");
  std::array<umbel::Hit, 5> hits;
  const size_t count = tree.all_hits(ray, hits);
  if ((count > 0) != hit.hit()) fail("closest and all hits disagree");
  for (size_t i = 0; i < count; ++i) check_hit(tree, hits[i]);
  const umbel::ClosestPoint closest = tree.closest_point(p);
  if (closest.primitive != umbel::kNone && closest.primitive >= tree.triangle_count())
    fail("a closest point on no triangle");
  tree.contains(p);
  for (const uint32_t primitive : tree.overlaps(umbel::Sphere{p, 0.25f}))
    if (primitive >= tree.triangle_count()) fail("an overlap of no triangle");
  tree.overlaps(umbel::Aabb{{p.x - 0.5f, p.y - 0.5f, p.z - 0.5f}, p});
}

void ask_everything(const TriangleBvh& tree) {
  const umbel::Aabb box = tree.bounds();
  ask(tree, {0, 0, 0}, {1, 0, 0});
  ask(tree, {0.1f, 0.2f, 0.3f}, {-0.5f, 0.25f, 1});
  ask(tree, box.min, {box.max.x - box.min.x, box.max.y - box.min.y, box.max.z - box.min.z});
  ask(tree, box.max, {0, -1, 0});
}

std::vector<Bytes> make_seeds() {
  std::vector<Bytes> seeds;
  for (const umbel::Mesh& mesh :
       {umbel::shapes::sphere(1), umbel::shapes::soup(20, 1), umbel::Mesh{}})
    for (const uint32_t width : {2u, 4u, 8u})
      for (const bool compact : {false, true}) {
        umbel::TriangleBvhConfig config;
        config.width = width, config.compact = compact;
        std::vector<uint32_t> masks;
        if (compact) masks.assign(mesh.triangles.size(), 5);
        TriangleBvh::build(mesh.view(), config, masks).save(umbel::fuzz::scratch());
        seeds.push_back(umbel::fuzz::read_file());
      }
  return seeds;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static const std::vector<Bytes> seeds = make_seeds();
  Bytes bytes = umbel::fuzz::file_of(seeds, data, size);
  umbel::fuzz::repair_checksums(bytes);
  umbel::fuzz::write_file(bytes);
  try {
    const TriangleBvh tree = TriangleBvh::load(umbel::fuzz::scratch());
    ask_everything(tree);
  } catch (const umbel::Error& error) {
    if (error.what()[0] == '\0') fail("an error without a sentence");
  }
  return 0;
}
