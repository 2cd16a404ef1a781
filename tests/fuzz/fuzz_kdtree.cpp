// Fuzzes the reading of .umkd files and the rays through what was read. Any file must be refused
// with a sentence, or give a tree whose queries stay within its arrays and come to an end, by the
// same hits whichever way they go through it.
#include <array>

#include "container_bytes.hpp"
#include "umbel/kdtree.hpp"

namespace {

using umbel::Vec3;
using umbel::fuzz::Bytes;
using umbel::fuzz::fail;
using umbel::kdtree::KdTree;
using umbel::kdtree::Traversal;

void check_hit(const KdTree& tree, const umbel::Hit& hit) {
  if (hit.hit() && hit.primitive >= tree.triangle_count()) fail("a hit of no triangle");
}

void ask(const KdTree& tree, const Vec3& p, const Vec3& d) {
  const umbel::Ray ray{p, 0, d};
  const umbel::Hit hit = tree.intersect(ray);
  check_hit(tree, hit);
  if (tree.occluded(ray) != hit.hit()) fail("closest and any hit disagree");
  std::array<umbel::Hit, 5> hits;
  const size_t count = tree.all_hits(ray, hits);
  if ((count > 0) != hit.hit()) fail("closest and all hits disagree");
  for (size_t i = 0; i < count; ++i) check_hit(tree, hits[i]);
}

void ask_everything(KdTree& tree) {
  const umbel::Aabb box = tree.bounds();
  for (const Traversal traversal : {Traversal::kStack, Traversal::kRopes, Traversal::kShortStack}) {
    tree.set_traversal(traversal);
    ask(tree, {0, 0, 0}, {1, 0, 0});
    ask(tree, {0.1f, 0.2f, 0.3f}, {-0.5f, 0.25f, 1});
    ask(tree, box.min, {box.max.x - box.min.x, box.max.y - box.min.y, box.max.z - box.min.z});
    ask(tree, box.max, {0, -1, 0});
  }
}

std::vector<Bytes> make_seeds() {
  std::vector<Bytes> seeds;
  for (const umbel::Mesh& mesh :
       {umbel::shapes::sphere(1), umbel::shapes::soup(20, 1), umbel::Mesh{}})
    for (const bool compact : {false, true}) {
      umbel::kdtree::KdTreeConfig config;
      config.compact = compact;
      std::vector<uint32_t> masks;
      if (compact) masks.assign(mesh.triangles.size(), 5);
      KdTree::build(mesh.view(), config, masks).save(umbel::fuzz::scratch());
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
    KdTree tree = KdTree::load(umbel::fuzz::scratch());
    ask_everything(tree);
  } catch (const umbel::Error& error) {
    if (error.what()[0] == '\0') fail("an error without a sentence");
  }
  return 0;
}
