// Trees that are built on a device: their merges must be the bytes of the processor.
#include "builders.hpp"
#include "cuda/cuda_exec.cuh"
#include "device_arrays.cuh"

namespace umbel::cuda {
namespace {

class BuildersOnDevice : public OnDevice {
 public:
  void expect_same(Builder builder) {
    const Mesh mesh = shapes::soup(20000, 5);
    const std::vector<Aabb> boxes = triangle_boxes(mesh.view());
    const auto n = uint32_t(boxes.size());
    std::vector<bvh::Merge> expected(n - 1);
    const bvh::Subtree root = run_on_processor(builder, boxes, expected);
    const DeviceArray<Aabb> device_boxes(boxes);
    const DeviceArray<bvh::Merge> merges(n - 1);
    constexpr size_t kScratch = size_t(1) << 26;
    const DeviceArray<unsigned char> scratch(kScratch);
    Arena arena(scratch.data(), kScratch);
    CudaExec exec(nullptr, arena);
    EXPECT_EQ(run_builder(builder, exec, device_boxes.data(), n, merges.data()).link, root.link);
    EXPECT_TRUE(same_bytes(merges.read(), expected));
  }
};

TEST_F(BuildersOnDevice, lbvh_is_that_of_the_processor) { expect_same(Builder::kLbvh); }
TEST_F(BuildersOnDevice, atrbvh_is_that_of_the_processor) { expect_same(Builder::kAtrbvh); }
TEST_F(BuildersOnDevice, ploc_is_that_of_the_processor) { expect_same(Builder::kPloc); }

}  // namespace
}  // namespace umbel::cuda
