#include "renderer.hpp"

#include <algorithm>
#include <stdexcept>
#include <string>

#include "layouts.hpp"
#include "projection.hpp"
#include "streaming.hpp"

namespace sample {

namespace {

constexpr uint32_t kMostInstances = 1u << 16;  // what a request has bits for

// mesh shaders have arrays for so many.
bool fits_mesh_shader(const Tables& tables) {
  return tables.max_triangles() <= 128 && tables.max_vertices() <= 128;
}

}  // namespace

Picture::Picture(const Device& device, uint32_t width, uint32_t height)
    : color(device, width, height, kColorFormat,
            VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT | VK_IMAGE_USAGE_TRANSFER_SRC_BIT,
            VK_IMAGE_ASPECT_COLOR_BIT),
      depth(device, width, height, kDepthFormat,
            VK_IMAGE_USAGE_DEPTH_STENCIL_ATTACHMENT_BIT | VK_IMAGE_USAGE_TRANSFER_SRC_BIT,
            VK_IMAGE_ASPECT_DEPTH_BIT),
      pyramid(device, width, height),
      readback(device, uint64_t{width} * height * 4, Place::kHost) {}

void Renderer::resize(uint32_t width, uint32_t height) {
  config_.width = width;
  config_.height = height;
  picture_ = std::make_unique<Picture>(device_, width, height);
}

Renderer::Renderer(const Device& device, const umbel::Asset& asset,
                   std::vector<umbel::Transform> instances, const RendererConfig& config)
    : device_(device),
      asset_(asset),
      config_(config),
      transforms_(std::move(instances)),
      tables_(device, asset),
      pool_(device, asset, tables_, config.budget_bytes),
      mesh_shaders_(config.mesh_shaders && device.mesh_shaders() && fits_mesh_shader(tables_)),
      pipelines_(device, mesh_shaders_),
      instances_(device, transforms_.size() * sizeof(GpuInstance), Place::kHost),
      frame_(device, sizeof(GpuFrame), Place::kHost),
      queue_(device, 2 * uint64_t{config.capacity} * sizeof(GpuItem), Place::kDevice),
      visible_(device, 2 * uint64_t{config.capacity} * sizeof(GpuItem), Place::kDevice),
      hidden_(device, uint64_t{config.capacity} * sizeof(GpuItem), Place::kDevice),
      counts_(device, sizeof(GpuCounts), Place::kDevice),
      counts_read_(device, sizeof(GpuCounts), Place::kHost),
      wanted_(device, tables_.host().groups.size() * 4, Place::kHost),
      picture_(std::make_unique<Picture>(device, config.width, config.height)),
      residency_(make_residency(asset, pool_.slots())) {
  if (transforms_.empty() || transforms_.size() > kMostInstances) {
    throw std::runtime_error("the sample draws 1 to 65536 instances.");
  }
}

FrameReport Renderer::draw(const FrameInput& wanted_input, double now) {
  FrameInput input = wanted_input;
  input.frozen &= report_.slots > 0;  // the first frame has none before it
  if (!input.frozen) {
    write_instances(input);
    pool_.update(asset_, *residency_);
  }
  write_frame(input);
  device_.run([&](VkCommandBuffer commands) {
    if (!input.frozen) {
      pool_.record(commands);
      record_selection(commands);
    }
    record_passes(commands, input);
    record_readback(commands);
  });
  if (input.frozen) return report_;
  check_capacity();
  if (input.occlusion) last_clip_from_world_ = frame_.mapped<GpuFrame>()[0].clip_from_world;
  const GpuCounts& counts = counts_read_.mapped<GpuCounts>()[0];
  const std::vector<umbel::StreamView> wanted = requests();
  report_.late = counts.draw[1][1];
  report_.clusters = counts.draw[0][1] + report_.late;
  report_.hidden = counts.hidden[3] - report_.late;
  report_.views = static_cast<uint32_t>(wanted.size());
  report_.step = residency_->step(wanted, now);
  report_.used_slots = pool_.used();
  report_.slots = pool_.slots();
  return report_;
}

void Renderer::check_capacity() const {
  if (counts_read_.mapped<GpuCounts>()[0].overflow == 0) return;
  throw std::runtime_error("more than " + std::to_string(config_.capacity) +
                           " clusters or nodes are visible: ask for a larger error.");
}

void Renderer::write_instances(const FrameInput& input) {
  const umbel::Camera& camera = input.camera;
  const float aspect = static_cast<float>(config_.width) / static_cast<float>(config_.height);
  const umbel::lod::View view =
      umbel::lod::view_camera(camera.position, camera.fov_y, config_.height, input.pixel_error);
  const std::vector<umbel::lod::Plane> planes =
      umbel::lod::frustum_planes(camera, aspect, input.near_plane);
  const std::span<GpuInstance> out = instances_.mapped<GpuInstance>();
  views_.clear();
  for (size_t i = 0; i < transforms_.size(); ++i) {
    umbel::StreamView& local = views_.emplace_back();
    local.view = umbel::lod::to_object(view, transforms_[i]);
    out[i] = {transforms_[i].rows, local.view.eye, local.view.threshold, {}};
    for (size_t p = 0; p < 5; ++p) {
      const umbel::lod::Plane plane = umbel::lod::to_object(planes[p], transforms_[i]);
      local.planes.push_back(plane);
      out[i].planes[p] = {plane.normal.x, plane.normal.y, plane.normal.z, plane.offset};
    }
  }
}

void Renderer::write_frame(const FrameInput& input) const {
  const float aspect = static_cast<float>(config_.width) / static_cast<float>(config_.height);
  const umbel::Vec3& eye = input.camera.position;
  frame_.mapped<GpuFrame>()[0] = {
      .clip_from_world = clip_from_world(input.camera, aspect, input.near_plane),
      .last_clip_from_world = last_clip_from_world_,
      .eye = {eye.x, eye.y, eye.z, 1},
      .nodes = tables_.nodes().address(),
      .groups = tables_.groups().address(),
      .clusters = tables_.clusters().address(),
      .instances = instances_.address(),
      .pool = pool_.words().address(),
      .first_word = pool_.first_word().address(),
      .usable = pool_.usable().address(),
      .wanted = wanted_.address(),
      .queue = queue_.address(),
      .visible = visible_.address(),
      .hidden = hidden_.address(),
      .pyramid = picture_->pyramid.address(),
      .counts = counts_.address(),
      .capacity = config_.capacity,
      .occlusion = input.occlusion ? 1u : 0u,
      .size = {config_.width, config_.height}};
}

void Renderer::record_selection(VkCommandBuffer commands) const {
  GpuCounts start;
  for (auto& layer : start.layers) layer = {0, 1, 1, 0};
  const uint32_t items = static_cast<uint32_t>(transforms_.size());
  start.layers[0] = {(items + 63) / 64, 1, 1, items};
  start.hidden = {0, 1, 1, 0};
  start.mesh_draw.fill({kRow, 0, 1, 0});
  start.draw.fill({3 * tables_.max_triangles(), 0, 0, 0});
  vkCmdUpdateBuffer(commands, counts_.handle(), 0, sizeof start, &start);
  vkCmdFillBuffer(commands, wanted_.handle(), 0, VK_WHOLE_SIZE, 0);
  vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_COMPUTE, pipelines_.select());
  for (uint32_t layer = 0; layer < tables_.layers(); ++layer) {
    wait_for_writes(commands);
    const GpuPush push{frame_.address(), layer, 0};
    vkCmdPushConstants(commands, pipelines_.layout(), VK_SHADER_STAGE_ALL, 0, kPushBytes, &push);
    vkCmdDispatchIndirect(commands, counts_.handle(), layer * sizeof start.layers[0]);
  }
  wait_for_writes(commands);
}

// First what was visible in the last frame, by its depth; with the depth of that, what is visible
// beside it. A wrong guess costs time, never a pixel.
void Renderer::record_passes(VkCommandBuffer commands, const FrameInput& input) const {
  picture_->color.change_layout(commands, VK_IMAGE_LAYOUT_UNDEFINED,
                                VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL);
  picture_->depth.change_layout(commands, VK_IMAGE_LAYOUT_UNDEFINED,
                                VK_IMAGE_LAYOUT_DEPTH_ATTACHMENT_OPTIMAL);
  begin_drawing(commands, input, true);
  record_pass(commands, input, 0);
  if (input.frozen) record_pass(commands, input, 1);
  vkCmdEndRendering(commands);
  if (input.frozen || !input.occlusion) return;

  picture_->depth.change_layout(commands, VK_IMAGE_LAYOUT_DEPTH_ATTACHMENT_OPTIMAL,
                                VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL);
  picture_->pyramid.record(commands, picture_->depth, pipelines_, frame_.address());
  vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_COMPUTE, pipelines_.retest());
  vkCmdDispatchIndirect(commands, counts_.handle(), offsetof(GpuCounts, hidden));
  wait_for_writes(commands);
  picture_->depth.change_layout(commands, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL,
                                VK_IMAGE_LAYOUT_DEPTH_ATTACHMENT_OPTIMAL);
  begin_drawing(commands, input, false);
  record_pass(commands, input, 1);
  vkCmdEndRendering(commands);
}

void Renderer::begin_drawing(VkCommandBuffer commands, const FrameInput& input, bool first) const {
  const VkAttachmentLoadOp load = first ? VK_ATTACHMENT_LOAD_OP_CLEAR : VK_ATTACHMENT_LOAD_OP_LOAD;
  const umbel::Vec4& b = input.background;
  const VkRenderingAttachmentInfo color{.sType = VK_STRUCTURE_TYPE_RENDERING_ATTACHMENT_INFO,
                                        .imageView = picture_->color.view(),
                                        .imageLayout = VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL,
                                        .loadOp = load,
                                        .storeOp = VK_ATTACHMENT_STORE_OP_STORE,
                                        .clearValue = {.color = {.float32 = {b.x, b.y, b.z, b.w}}}};
  const VkRenderingAttachmentInfo depth{.sType = VK_STRUCTURE_TYPE_RENDERING_ATTACHMENT_INFO,
                                        .imageView = picture_->depth.view(),
                                        .imageLayout = VK_IMAGE_LAYOUT_DEPTH_ATTACHMENT_OPTIMAL,
                                        .loadOp = load,
                                        .storeOp = VK_ATTACHMENT_STORE_OP_STORE,
                                        .clearValue = {.depthStencil = {0, 0}}};
  const VkRect2D area{{0, 0}, {config_.width, config_.height}};
  const VkRenderingInfo info{.sType = VK_STRUCTURE_TYPE_RENDERING_INFO,
                             .renderArea = area,
                             .layerCount = 1,
                             .colorAttachmentCount = 1,
                             .pColorAttachments = &color,
                             .pDepthAttachment = &depth};
  const VkViewport viewport{
      0, 0, static_cast<float>(config_.width), static_cast<float>(config_.height), 0, 1};
  vkCmdBeginRendering(commands, &info);
  vkCmdSetViewport(commands, 0, 1, &viewport);
  vkCmdSetScissor(commands, 0, 1, &area);
}

void Renderer::record_pass(VkCommandBuffer commands, const FrameInput& input, uint32_t pass) const {
  const GpuPush push{frame_.address(), static_cast<uint32_t>(input.looks), pass};
  vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, pipelines_.draw());
  vkCmdPushConstants(commands, pipelines_.layout(), VK_SHADER_STAGE_ALL, 0, kPushBytes, &push);
  const uint64_t draw = pass * sizeof(GpuCounts::draw) / 2;
  if (mesh_shaders_) {
    vkCmdDrawMeshTasksIndirectEXT(commands, counts_.handle(), offsetof(GpuCounts, mesh_draw) + draw,
                                  1, 16);
  } else {
    vkCmdDrawIndirect(commands, counts_.handle(), offsetof(GpuCounts, draw) + draw, 1, 16);
  }
}

void Renderer::record_readback(VkCommandBuffer commands) const {
  picture_->color.change_layout(commands, VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL,
                                VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL);
  const VkBufferImageCopy copy{.imageSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, 1},
                               .imageExtent = {config_.width, config_.height, 1}};
  vkCmdCopyImageToBuffer(commands, picture_->color.handle(), VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL,
                         picture_->readback.handle(), 1, &copy);
  const VkBufferCopy counts{.size = sizeof(GpuCounts)};
  vkCmdCopyBuffer(commands, counts_.handle(), counts_read_.handle(), 1, &counts);
  wait_for_writes(commands);
}

// The instances that want some group the most. Whatever any instance wants, one of these wants, so
// of thousands of instances the residency follows only the few that differ.
std::vector<umbel::StreamView> Renderer::requests() const {
  std::vector<uint32_t> instances;
  for (const uint32_t request : wanted_.mapped<uint32_t>().first(tables_.host().groups.size())) {
    if (request != 0) instances.push_back(request & 0xffff);
  }
  std::sort(instances.begin(), instances.end());
  instances.erase(std::unique(instances.begin(), instances.end()), instances.end());
  std::vector<umbel::StreamView> wanted;
  for (const uint32_t i : instances) wanted.push_back(views_[i]);
  return wanted;
}

}  // namespace sample
