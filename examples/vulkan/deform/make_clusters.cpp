#include "deform/deforming_clusters.hpp"
#include "deform/reclusterer.hpp"
#ifdef SAMPLE_HAS_CUDA
#include "deform/cuda_clusters.hpp"
#include "unavailable.hpp"
#endif

namespace sample {

std::unique_ptr<DeformingClusters> make_clusters(const Device& device, const umbel::Mesh& mesh,
                                                 uint32_t max_triangles) {
#ifdef SAMPLE_HAS_CUDA
  try {
    return std::make_unique<CudaClusters>(device, mesh, max_triangles);
  } catch (const Unavailable&) {
    // No device of CUDA, or another than Vulkan's: compute shaders can do it, too.
  }
#endif
  return std::make_unique<Reclusterer>(device, mesh, max_triangles);
}

}  // namespace sample
