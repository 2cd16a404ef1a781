#include "deform/deforming_renderer.hpp"

#include "clock.hpp"
#include "ray_camera.hpp"
#include "shader_module.hpp"

namespace sample {

namespace {

#include "deform.rchit.h"

}  // namespace

DeformingRenderer::DeformingRenderer(const Device& device, const umbel::Mesh& mesh,
                                     uint32_t max_triangles, uint32_t width, uint32_t height)
    : device_(device),
      width_(width),
      height_(height),
      pipeline_(device, deform_rchit),
      clusters_(make_clusters(device, mesh, max_triangles)),
      structures_(device),
      frame_(device, sizeof(GpuFrame), Place::kHost),
      rays_(device, sizeof(GpuRays), Place::kHost),
      traced_(device, uint64_t{width} * height * 4, Place::kDevice),
      readback_(device, uint64_t{width} * height * 4, Place::kHost) {}

umbel::RebuildPolicy::Action DeformingRenderer::cluster(const umbel::RebuildPolicy& policy) {
  using Action = umbel::RebuildPolicy::Action;
  ++frames_since_;
  Action action = Action::kRebuild;
  if (clusters_->count() > 0) {
    clusters_->refit();
    action = policy.decide(clusters_->growth(), frames_since_);
  }
  if (action == Action::kRebuild) clusters_->build();
  if (action == Action::kRebuildWorst) {
    clusters_->rebuild_worst(static_cast<uint32_t>(policy.budget * clusters_->count()));
  }
  if (action != Action::kKeep) frames_since_ = 0;
  return action;
}

DeformReport DeformingRenderer::draw(float time, const umbel::RebuildPolicy& policy,
                                     const FrameInput& input) {
  DeformReport report;
  const auto timed = [](double& milliseconds, const auto& work) {
    const Clock clock;
    work();
    milliseconds = 1e3 * clock.seconds();
  };
  timed(report.times.deform, [&] { clusters_->deform(time); });
  timed(report.times.clusters, [&] { report.action = cluster(policy); });
  timed(report.times.structures, [&] { structures_.follow(*clusters_); });
  timed(report.times.scene, [&] { structures_.build_scene(); });
  write_frame(input);
  timed(report.times.trace, [&] {
    device_.run([&](VkCommandBuffer commands) {
      const GpuPush push{frame_.address(), static_cast<uint32_t>(input.looks), 0};
      pipeline_.record(commands, &push, width_, height_);
      wait_for_writes(commands);
      const VkBufferCopy all{.size = uint64_t{width_} * height_ * 4};
      vkCmdCopyBuffer(commands, traced_.handle(), readback_.handle(), 1, &all);
      wait_for_writes(commands);
    });
  });
  report.growth = clusters_->growth();
  report.clusters = clusters_->count();
  report.built = structures_.built();
  report.structure_bytes = structures_.bytes();
  return report;
}

void DeformingRenderer::write_frame(const FrameInput& input) const {
  GpuRays rays = rays_through(input, width_, height_);
  rays.scene = structures_.scene();
  rays.picture = traced_.address();
  rays.positions = clusters_->positions().address();
  rays.triangles = clusters_->triangles().address();
  rays.offsets = clusters_->offsets_buffer().address();
  rays_.mapped<GpuRays>()[0] = rays;
  const umbel::Vec3& eye = input.camera.position;
  frame_.mapped<GpuFrame>()[0] = {
      .eye = {eye.x, eye.y, eye.z, 1}, .rays = rays_.address(), .size = {width_, height_}};
}

}  // namespace sample
