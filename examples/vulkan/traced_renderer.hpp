// A frame, traced: pages, the cut on the host, structures where the cut changed, rays.
#pragma once

#include <memory>
#include <vector>

#include "acceleration.hpp"
#include "frame.hpp"
#include "page_pool.hpp"
#include "ray_pipeline.hpp"
#include "tables.hpp"
#include "traced_groups.hpp"

namespace sample {

class TracedRenderer : public FrameMaker {
 public:
  /// The asset must outlive it. Throws Unavailable for a device without ray tracing.
  TracedRenderer(const Device& device, const umbel::Asset& asset,
                 std::vector<umbel::Transform> instances, const RendererConfig& config);

  /// Throws where there are more geometries, or instances of groups, than Vulkan has numbers for.
  FrameReport draw(const FrameInput& input, double now) override;
  std::span<const uint8_t> pixels() const override { return target_->readback.mapped<uint8_t>(); }
  const Image& color() const override { return target_->color; }
  void resize(uint32_t width, uint32_t height) override;
  std::string method() const override { return "traced by the ray tracing pipeline"; }

 private:
  /// What rays write, and copies of it.
  struct Target {
    Target(const Device& device, uint32_t width, uint32_t height);
    Buffer traced, readback;
    Image color;
  };

  void choose_views(const FrameInput& input);
  void find_cut(FrameReport& report);
  void build_scene();
  void write_frame(const FrameInput& input) const;
  void record_copies(VkCommandBuffer commands) const;
  template <class T>
  void upload(std::unique_ptr<Buffer>& buffer, std::span<const T> values) const;

  const Device& device_;
  const umbel::Asset& asset_;
  RendererConfig config_;
  std::vector<umbel::Transform> transforms_;
  std::vector<umbel::StreamView> views_;  ///< one an instance
  Tables tables_;
  PagePool pool_;
  RayPipeline pipeline_;
  TracedGroups groups_;
  std::vector<VkAccelerationStructureInstanceKHR> placed_;
  std::vector<uint32_t> numbers_;       ///< of each one's structure in groups_
  std::vector<uint32_t> all_clusters_;  ///< 0, 1, 2, ...
  std::unique_ptr<Buffer> placed_buffer_, clusters_buffer_;
  std::shared_ptr<AccelerationStructure> scene_;
  Buffer frame_, rays_;
  std::unique_ptr<Target> target_;
  FrameReport report_;
  std::unique_ptr<umbel::Residency> residency_;
};

}  // namespace sample
