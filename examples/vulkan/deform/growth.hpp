// How much the boxes of clusters have grown since each was built, as umbel::FrameClusterer measures
// it: by shares of the box of all, whole numbers, so that sums depend on no order.
#pragma once

#include <cstdint>
#include <span>
#include <umbel/frame_clusters.hpp>
#include <vector>

namespace sample {

class Growth {
 public:
  /// Measures boxes of as many clusters as before.
  void measure(std::span<const umbel::Aabb> boxes);
  /// Clusters from number `kept` on are compared with what they are now; the first `kept` are those
  /// that had `numbers` before.
  void rebuilt(std::span<const umbel::Aabb> boxes, std::span<const uint32_t> numbers);
  umbel::AreaGrowth growth() const;
  /// Up to `most` clusters, those that have grown by the largest factors, ascending.
  std::vector<uint32_t> worst(uint32_t most) const;

 private:
  std::vector<uint64_t> now_, at_build_;
};

}  // namespace sample
