#include "traced_renderer.hpp"

#include <algorithm>
#include <cstring>
#include <numeric>
#include <stdexcept>

#include "host_cut.hpp"
#include "layouts.hpp"
#include "ray_camera.hpp"
#include "streaming.hpp"

namespace sample {

namespace {

// Compiled by CMake: an array of words.
#include "trace.rchit.h"

constexpr uint32_t kMostGeometries = 1u << 24;  // a custom index has 24 bits
}  // namespace

TracedRenderer::Target::Target(const Device& device, uint32_t width, uint32_t height)
    : traced(device, uint64_t{width} * height * 4, Place::kDevice),
      readback(device, uint64_t{width} * height * 4, Place::kHost),
      color(device, width, height, kColorFormat,
            VK_IMAGE_USAGE_TRANSFER_DST_BIT | VK_IMAGE_USAGE_TRANSFER_SRC_BIT |
                VK_IMAGE_USAGE_SAMPLED_BIT,
            VK_IMAGE_ASPECT_COLOR_BIT) {}

TracedRenderer::TracedRenderer(const Device& device, const umbel::Asset& asset,
                               std::vector<umbel::Transform> instances,
                               const RendererConfig& config)
    : device_(device),
      asset_(asset),
      config_(config),
      transforms_(std::move(instances)),
      tables_(device, asset),
      pool_(device, asset, tables_, config.budget_bytes),
      pipeline_(device, trace_rchit),
      groups_(device, tables_),
      frame_(device, sizeof(GpuFrame), Place::kHost),
      rays_(device, sizeof(GpuRays), Place::kHost),
      target_(std::make_unique<Target>(device, config.width, config.height)),
      residency_(make_residency(asset, pool_.slots())) {
  all_clusters_.resize(tables_.host().clusters.size());
  std::iota(all_clusters_.begin(), all_clusters_.end(), 0u);
}

void TracedRenderer::resize(uint32_t width, uint32_t height) {
  config_.width = width;
  config_.height = height;
  target_ = std::make_unique<Target>(device_, width, height);
}

FrameReport TracedRenderer::draw(const FrameInput& input, double now) {
  const bool frozen = input.frozen && report_.slots > 0;
  if (!frozen) {
    choose_views(input);
    pool_.update(asset_, *residency_);
    find_cut(report_);
    device_.run([&](VkCommandBuffer commands) {
      pool_.record(commands);
      wait_for_writes(commands);
    });
    groups_.build(tables_, pool_);
    build_scene();
  }
  write_frame(input);
  device_.run([&](VkCommandBuffer commands) {
    const GpuPush push{frame_.address(), static_cast<uint32_t>(input.looks), 0};
    pipeline_.record(commands, &push, config_.width, config_.height);
    wait_for_writes(commands);
    record_copies(commands);
  });
  if (frozen) return report_;
  report_.step = residency_->step(views_, now);
  report_.views = static_cast<uint32_t>(views_.size());
  report_.used_slots = pool_.used();
  report_.slots = pool_.slots();
  report_.built = groups_.built();
  report_.kept = groups_.kept();
  report_.structure_bytes = groups_.bytes() + scene_->bytes();
  return report_;
}

// Without planes: what is behind the camera throws shadows, too.
void TracedRenderer::choose_views(const FrameInput& input) {
  const umbel::Camera& camera = input.camera;
  const umbel::lod::View view =
      umbel::lod::view_camera(camera.position, camera.fov_y, config_.height, input.pixel_error);
  views_.clear();
  for (const umbel::Transform& transform : transforms_) {
    views_.push_back({.view = umbel::lod::to_object(view, transform)});
  }
}

void TracedRenderer::find_cut(FrameReport& report) {
  groups_.begin();
  placed_.clear();
  numbers_.clear();
  report.clusters = 0;
  const std::span<const uint32_t> usable = pool_.usable().mapped<uint32_t>();
  for (size_t i = 0; i < transforms_.size(); ++i) {
    for_groups_of_cut(
        tables_.host(), usable, views_[i].view, [&](uint32_t, std::span<const uint32_t> clusters) {
          VkAccelerationStructureInstanceKHR& instance = placed_.emplace_back();
          std::memcpy(&instance.transform, transforms_[i].rows.data(), sizeof instance.transform);
          instance.mask = 0xff;
          numbers_.push_back(groups_.show(clusters));
          report.clusters += static_cast<uint32_t>(clusters.size());
        });
  }
  if (groups_.clusters().size() > kMostGeometries) {
    throw std::runtime_error("more than 2^24 clusters are visible: ask for a larger error.");
  }
}

template <class T>
void TracedRenderer::upload(std::unique_ptr<Buffer>& buffer, std::span<const T> values) const {
  if (buffer == nullptr || buffer->bytes() < values.size_bytes()) {
    buffer.reset();
    buffer = std::make_unique<Buffer>(device_, values.size_bytes() * 3 / 2, Place::kHost);
  }
  std::copy(values.begin(), values.end(), buffer->mapped<T>().begin());
}

// The top level is small, and built anew in every frame.
void TracedRenderer::build_scene() {
  const bool numbered = groups_.numbers_clusters();
  for (size_t i = 0; i < placed_.size(); ++i) {
    placed_[i].instanceCustomIndex = numbered ? 0 : groups_.first_cluster(numbers_[i]) & 0xffffff;
    placed_[i].accelerationStructureReference = groups_.address(numbers_[i]);
  }
  upload(placed_buffer_, std::span<const VkAccelerationStructureInstanceKHR>(placed_));
  upload(clusters_buffer_,
         std::span<const uint32_t>(numbered ? all_clusters_ : groups_.clusters()));
  const VkAccelerationStructureGeometryInstancesDataKHR instances{
      .sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_INSTANCES_DATA_KHR,
      .data = {.deviceAddress = placed_buffer_->address()}};
  const StructureInput input{
      .geometries = {{.sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_KHR,
                      .geometryType = VK_GEOMETRY_TYPE_INSTANCES_KHR,
                      .geometry = {.instances = instances},
                      .flags = VK_GEOMETRY_OPAQUE_BIT_KHR}},
      .ranges = {{.primitiveCount = static_cast<uint32_t>(placed_.size())}}};
  const StructureBuilds builds(device_, VK_ACCELERATION_STRUCTURE_TYPE_TOP_LEVEL_KHR,
                               std::span(&input, 1));
  device_.run([&](VkCommandBuffer commands) {
    builds.record(commands);
    wait_for_writes(commands);
  });
  scene_ = builds.structures()[0];
}

void TracedRenderer::write_frame(const FrameInput& input) const {
  GpuRays rays = rays_through(input, config_.width, config_.height);
  rays.scene = scene_->address();
  rays.clusters = clusters_buffer_->address();
  rays.picture = target_->traced.address();
  rays_.mapped<GpuRays>()[0] = rays;
  const umbel::Vec3& eye = input.camera.position;
  frame_.mapped<GpuFrame>()[0] = {.eye = {eye.x, eye.y, eye.z, 1},
                                  .groups = tables_.groups().address(),
                                  .clusters = tables_.clusters().address(),
                                  .pool = pool_.words().address(),
                                  .first_word = pool_.first_word().address(),
                                  .rays = rays_.address(),
                                  .size = {config_.width, config_.height}};
}

void TracedRenderer::record_copies(VkCommandBuffer commands) const {
  const VkBufferCopy all{.size = uint64_t{config_.width} * config_.height * 4};
  vkCmdCopyBuffer(commands, target_->traced.handle(), target_->readback.handle(), 1, &all);
  target_->color.change_layout(commands, VK_IMAGE_LAYOUT_UNDEFINED,
                               VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL);
  const VkBufferImageCopy copy{.imageSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, 1},
                               .imageExtent = {config_.width, config_.height, 1}};
  vkCmdCopyBufferToImage(commands, target_->traced.handle(), target_->color.handle(),
                         VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL, 1, &copy);
  target_->color.change_layout(commands, VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL,
                               VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL);
  wait_for_writes(commands);
}

}  // namespace sample
