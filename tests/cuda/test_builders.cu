// The builders of trees that are written over an executor, on a device: the merges must be the
// bytes of the processor.
#include "base/morton.hpp"
#include "bvh/ploc.hpp"
#include "bvh/radix_merges.hpp"
#include "bvh/treelet.hpp"
#include "cuda/cuda_exec.cuh"
#include "device_arrays.cuh"

namespace umbel::cuda {
namespace {

using bvh::Merge;
using bvh::Subtree;

std::vector<Aabb> boxes() {
  const Mesh mesh = shapes::soup(20000, 5);
  return triangle_boxes(mesh.view());
}

template <typename Exec>
Subtree build_atrbvh(Exec& exec, const Aabb* boxes, uint32_t n, Merge* merges) {
  const auto order = morton_order<uint64_t>(exec, boxes, n, 20);
  const Subtree root =
      bvh::radix_merges(exec, order.codes.data(), order.primitives.data(), boxes, n, merges);
  bvh::TreeletRounds<Exec> rounds(exec, bvh::TreeletInput{boxes, nullptr, n, merges}, root,
                                  bvh::LeafRule(bvh::Config{}));
  for (int i = 0; i < 2; ++i) rounds.run_round(9);
  return root;
}

template <typename Exec>
Subtree build_lbvh(Exec& exec, const Aabb* boxes, uint32_t n, Merge* merges) {
  const auto order = morton_order<uint64_t>(exec, boxes, n, 21);
  return bvh::radix_merges(exec, order.codes.data(), order.primitives.data(), boxes, n, merges);
}

template <typename Exec>
Subtree build_ploc(Exec& exec, const Aabb* boxes, uint32_t n, Merge* merges) {
  return bvh::Ploc<Exec>().run(exec, boxes, n, 16, merges);
}

#define EXPECT_SAME_MERGES(build)                                            \
  do {                                                                       \
    const std::vector<Aabb> host = boxes();                                  \
    const auto n = uint32_t(host.size());                                    \
    std::vector<Merge> expected(n - 1);                                      \
    CpuExec cpu;                                                             \
    const Subtree root = build(cpu, host.data(), n, expected.data());        \
    const DeviceArray<Aabb> device(host);                                    \
    const DeviceArray<Merge> merges(n - 1);                                  \
    constexpr size_t kScratch = size_t(1) << 26;                             \
    const DeviceArray<unsigned char> scratch(kScratch);                      \
    Arena arena(scratch.data(), kScratch);                                   \
    CudaExec exec(nullptr, arena);                                           \
    EXPECT_EQ(build(exec, device.data(), n, merges.data()).link, root.link); \
    EXPECT_TRUE(same_bytes(merges.read(), expected));                        \
  } while (false)

class BuildersOnDevice : public OnDevice {};
TEST_F(BuildersOnDevice, lbvh) { EXPECT_SAME_MERGES(build_lbvh); }
TEST_F(BuildersOnDevice, atrbvh) { EXPECT_SAME_MERGES(build_atrbvh); }
TEST_F(BuildersOnDevice, ploc) { EXPECT_SAME_MERGES(build_ploc); }

}  // namespace
}  // namespace umbel::cuda
