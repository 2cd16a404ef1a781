// Fuzzes the reading of .umkd files and the rays through what was read. Any file must be refused
// with a sentence, or give a tree whose queries stay within its arrays and come to an end, by the
// same hits whichever way they go through it.
#include "structure_file.hpp"
#include "umbel/kdtree.hpp"

namespace {

using umbel::fuzz::Bytes;
using umbel::kdtree::KdTree;
using umbel::kdtree::Traversal;

std::vector<umbel::kdtree::KdTreeConfig> configs() {
  std::vector<umbel::kdtree::KdTreeConfig> all(2);
  all[1].compact = true;
  return all;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static const std::vector<Bytes> seeds = umbel::fuzz::make_seeds<KdTree>(configs());
  umbel::fuzz::read_and_ask<KdTree>(seeds, data, size, [](KdTree& tree) {
    for (const Traversal traversal :
         {Traversal::kStack, Traversal::kRopes, Traversal::kShortStack}) {
      tree.set_traversal(traversal);
      umbel::fuzz::ask_everything(tree);
    }
  });
  return 0;
}
