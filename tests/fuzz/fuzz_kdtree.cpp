// Fuzzes the reading of .umkd files and the rays through what was read. Any file must be refused
// with a sentence, or give a tree whose queries stay within its arrays and come to an end, by the
// same hits whichever way they go through it.
#include "structure_file.hpp"
#include "umbel/kdtree.hpp"

namespace {

using umbel::fuzz::Bytes;
using umbel::kdtree::KdTree;
using umbel::kdtree::Traversal;

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
  umbel::fuzz::read_and_ask<KdTree>(seeds, data, size, [](KdTree& tree) {
    for (const Traversal traversal :
         {Traversal::kStack, Traversal::kRopes, Traversal::kShortStack}) {
      tree.set_traversal(traversal);
      umbel::fuzz::ask_everything(tree);
    }
  });
  return 0;
}
