// Fuzzes the reading of .umbvh files and the queries on what was read: the bytes are a file, whose
// checksums are repaired so that what lies behind them is reached. Any file must be refused with a
// sentence, or give a tree whose queries stay within its arrays and come to an end.
#include "structure_file.hpp"
#include "umbel/triangle_bvh.hpp"

namespace {

using umbel::Bvh;
using umbel::fuzz::Bytes;

std::vector<Bytes> make_seeds() {
  std::vector<Bytes> seeds;
  for (const umbel::Mesh& mesh :
       {umbel::shapes::sphere(1), umbel::shapes::soup(20, 1), umbel::Mesh{}})
    for (const uint32_t width : {2u, 4u, 8u})
      for (const bool compact : {false, true}) {
        umbel::BvhConfig config;
        config.width = width, config.compact = compact;
        std::vector<uint32_t> masks;
        if (compact) masks.assign(mesh.triangles.size(), 5);
        Bvh::build(mesh.view(), config, masks).save(umbel::fuzz::scratch());
        seeds.push_back(umbel::fuzz::read_file());
      }
  return seeds;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static const std::vector<Bytes> seeds = make_seeds();
  umbel::fuzz::read_and_ask<Bvh>(seeds, data, size,
                                 [](const Bvh& tree) { umbel::fuzz::ask_everything(tree); });
  return 0;
}
