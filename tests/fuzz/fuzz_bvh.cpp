// Fuzzes the reading of .umbvh files and the queries on what was read: the bytes are a file, whose
// checksums are repaired so that what lies behind them is reached. Any file must be refused with a
// sentence, or give a tree whose queries stay within its arrays and come to an end.
#include "structure_file.hpp"
#include "umbel/triangle_bvh.hpp"

namespace {

using umbel::Bvh;
using umbel::fuzz::Bytes;

std::vector<umbel::BvhConfig> configs() {
  std::vector<umbel::BvhConfig> all;
  for (const uint32_t width : {2u, 4u, 8u})
    for (const bool compact : {false, true}) {
      umbel::BvhConfig config;
      config.width = width, config.compact = compact;
      all.push_back(config);
    }
  return all;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static const std::vector<Bytes> seeds = umbel::fuzz::make_seeds<Bvh>(configs());
  umbel::fuzz::read_and_ask<Bvh>(seeds, data, size,
                                 [](const Bvh& tree) { umbel::fuzz::ask_everything(tree); });
  return 0;
}
