#include "deform/reclusterer.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numeric>
#include <stdexcept>

#include "deform/morton_grid.hpp"

namespace sample {

namespace {

// Compiled by CMake: an array of words each.
#include "center_bounds.comp.h"
#include "cluster_boxes.comp.h"
#include "deform.comp.h"
#include "morton_codes.comp.h"
#include "radix_count.comp.h"
#include "radix_scan.comp.h"
#include "radix_scatter.comp.h"
#include "write_triangles.comp.h"

constexpr uint32_t kMostTriangles = 1u << 22;
constexpr uint32_t kPasses = 4;  // of eight bits; an even number, so that the values come back

uint32_t groups_of(uint32_t count, uint32_t size) { return (count + size - 1) / size; }

uint32_t checked_size(const umbel::Mesh& mesh) {
  if (mesh.triangles.empty() || mesh.triangles.size() > kMostTriangles) {
    throw std::runtime_error("the sample clusters 1 to 4194304 triangles.");
  }
  return static_cast<uint32_t>(mesh.triangles.size());
}

// The reverse of ordered() in mesh.glsl.
float unordered(uint32_t u) {
  return std::bit_cast<float>((u & 0x80000000u) != 0 ? u & 0x7fffffffu : ~u);
}

float largest_extent(const umbel::Mesh& mesh) {
  umbel::Vec3 low = mesh.positions[0], high = low;
  for (const umbel::Vec3& p : mesh.positions) {
    low = {std::min(low.x, p.x), std::min(low.y, p.y), std::min(low.z, p.z)};
    high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
  }
  return std::max({high.x - low.x, high.y - low.y, high.z - low.z});
}

}  // namespace

Reclusterer::Reclusterer(const Device& device, const umbel::Mesh& mesh, uint32_t max_triangles,
                         Place positions)
    : device_(device),
      max_triangles_(max_triangles),
      vertices_(static_cast<uint32_t>(mesh.positions.size())),
      size_(checked_size(mesh)),
      extent_(largest_extent(mesh)),
      deform_(device, deform_comp, sizeof(GpuMeshPush)),
      center_bounds_(device, center_bounds_comp, sizeof(GpuMeshPush)),
      codes_(device, morton_codes_comp, sizeof(GpuMeshPush)),
      radix_count_(device, radix_count_comp, sizeof(GpuMeshPush)),
      radix_scan_(device, radix_scan_comp, sizeof(GpuMeshPush)),
      radix_scatter_(device, radix_scatter_comp, sizeof(GpuMeshPush)),
      write_(device, write_triangles_comp, sizeof(GpuMeshPush)),
      cluster_boxes_(device, cluster_boxes_comp, sizeof(GpuMeshPush)),
      rest_(device, 12 * uint64_t{vertices_}, Place::kDevice),
      positions_(device, 12 * uint64_t{vertices_}, positions),
      source_(device, 12 * uint64_t{size_}, Place::kDevice),
      source_items_(device, 4 * uint64_t{size_}, Place::kDevice),
      keys_{{device, 4 * uint64_t{size_}, Place::kDevice},
            {device, 4 * uint64_t{size_}, Place::kDevice}},
      values_{{device, 4 * uint64_t{size_}, Place::kDevice},
              {device, 4 * uint64_t{size_}, Place::kDevice}},
      counts_(device, 4 * 256 * uint64_t{groups_of(size_, kThreads * kTiles)}, Place::kDevice),
      bounds_(device, 24, Place::kHost),
      grid_(device, sizeof(GpuGrid), Place::kHost),
      // A rebuild of some leaves one run that is not full, so clusters can become more with time.
      offsets_(device, 4 * (uint64_t{size_} + 1), Place::kHost),
      boxes_(device, sizeof(umbel::Aabb) * uint64_t{size_}, Place::kHost),
      mesh_(device, sizeof(GpuMesh), Place::kHost) {
  for (auto* buffer : {&triangles_, &other_triangles_}) {
    *buffer = std::make_unique<Buffer>(device, 12 * uint64_t{size_}, Place::kDevice);
  }
  for (auto* buffer : {&items_, &other_items_}) {
    *buffer = std::make_unique<Buffer>(device, 4 * uint64_t{size_}, Place::kDevice);
  }
  std::vector<uint32_t> numbers(size_);
  std::iota(numbers.begin(), numbers.end(), 0u);
  rest_.fill(std::as_bytes(std::span(mesh.positions)));
  source_.fill(std::as_bytes(std::span(mesh.triangles)));
  source_items_.fill(std::as_bytes(std::span(numbers)));
}

GpuMeshPush Reclusterer::push(uint32_t first, uint32_t count, uint32_t pass) const {
  return {mesh_.address(), first, count, pass, groups_of(count, kThreads * kTiles)};
}

void Reclusterer::write_mesh(const Buffer& from, const Buffer& from_items) {
  mesh_.mapped<GpuMesh>()[0] = {.rest = rest_.address(),
                                .positions = positions_.address(),
                                .source = from.address(),
                                .triangles = triangles_->address(),
                                .source_items = from_items.address(),
                                .items = items_->address(),
                                .keys = {keys_[0].address(), keys_[1].address()},
                                .values = {values_[0].address(), values_[1].address()},
                                .counts = counts_.address(),
                                .bounds = bounds_.address(),
                                .grid = grid_.address(),
                                .offsets = offsets_.address(),
                                .boxes = boxes_.address(),
                                .vertices = vertices_,
                                .time = time_,
                                .size = extent_};
}

void Reclusterer::deform(float time) { deform(time, VK_NULL_HANDLE); }

void Reclusterer::deform(float time, VkSemaphore signal) {
  time_ = time;
  write_mesh(source_, source_items_);
  device_.run(
      [&](VkCommandBuffer commands) {
        const GpuMeshPush all = push(0, size_);
        deform_.record(commands, &all, groups_of(vertices_, kThreads));
      },
      VK_NULL_HANDLE, signal);
}

// The grid is made on the host: a few lines, in double precision, which not all devices have.
void Reclusterer::sort_into_runs(const Buffer& from, const Buffer& from_items, uint32_t first,
                                 uint32_t count) {
  if (count == 0) return;
  write_mesh(from, from_items);
  const std::span<uint32_t> bounds = bounds_.mapped<uint32_t>();
  std::fill_n(bounds.begin(), 3, 0xffffffffu);
  std::fill_n(bounds.begin() + 3, 3, 0u);
  const GpuMeshPush all = push(first, count);
  const uint32_t threads = groups_of(count, kThreads);
  device_.run([&](VkCommandBuffer commands) { center_bounds_.record(commands, &all, threads); });
  grid_.mapped<GpuGrid>()[0] =
      grid_around({{unordered(bounds[0]), unordered(bounds[1]), unordered(bounds[2])},
                   {unordered(bounds[3]), unordered(bounds[4]), unordered(bounds[5])}});
  device_.run([&](VkCommandBuffer commands) {
    codes_.record(commands, &all, threads);
    for (uint32_t pass = 0; pass < kPasses; ++pass) {
      const GpuMeshPush digit = push(first, count, pass);
      radix_count_.record(commands, &digit, digit.groups);
      radix_scan_.record(commands, &digit, 1);
      radix_scatter_.record(commands, &digit, digit.groups);
    }
    write_.record(commands, &all, threads);
  });
  for (uint32_t at = 0; at < count; at += max_triangles_) {
    offsets_host_.push_back(first + std::min(at + max_triangles_, count));
  }
}

void Reclusterer::write_offsets() {
  std::copy(offsets_host_.begin(), offsets_host_.end(), offsets_.mapped<uint32_t>().begin());
}

void Reclusterer::find_boxes() {
  write_mesh(source_, source_items_);
  device_.run([&](VkCommandBuffer commands) {
    const GpuMeshPush all = push(0, size_);
    cluster_boxes_.record(commands, &all, count());
  });
}

void Reclusterer::build() {
  offsets_host_ = {0};
  kept_.clear();
  sort_into_runs(source_, source_items_, 0, size_);
  write_offsets();
  find_boxes();
  growth_.rebuilt(boxes(), {});
}

void Reclusterer::refit() {
  kept_.resize(count());
  std::iota(kept_.begin(), kept_.end(), 0u);
  find_boxes();
  growth_.measure(boxes());
}

// Triangles of a cluster are consecutive, so copies separate those that stay from the others.
void Reclusterer::rebuild_worst(uint32_t clusters) {
  refit();
  const std::vector<uint32_t> worst = growth_.worst(clusters);
  if (worst.empty()) return;
  kept_.clear();
  std::vector<uint32_t> offsets{0}, order;
  for (uint32_t c = 0; c < count(); ++c) {
    if (!std::binary_search(worst.begin(), worst.end(), c)) kept_.push_back(c);
  }
  order = kept_;
  order.insert(order.end(), worst.begin(), worst.end());
  std::vector<VkBufferCopy> copies;
  uint32_t to = 0;
  for (const uint32_t c : order) {
    const uint32_t begin = offsets_host_[c], size = offsets_host_[c + 1] - begin;
    copies.push_back({.srcOffset = begin, .dstOffset = to, .size = size});
    to += size;
    if (offsets.size() <= kept_.size()) offsets.push_back(to);
  }
  device_.run([&](VkCommandBuffer commands) {
    for (const uint32_t bytes : {12u, 4u}) {
      std::vector<VkBufferCopy> scaled = copies;
      for (VkBufferCopy& copy : scaled) {
        copy = {copy.srcOffset * bytes, copy.dstOffset * bytes, copy.size * bytes};
      }
      vkCmdCopyBuffer(commands, (bytes == 12 ? triangles_ : items_)->handle(),
                      (bytes == 12 ? other_triangles_ : other_items_)->handle(),
                      static_cast<uint32_t>(scaled.size()), scaled.data());
    }
    wait_for_writes(commands);
  });
  const uint32_t first = offsets.back();
  // Sorted into the buffers they came from; then the front, which stays, goes back there, too.
  offsets_host_ = offsets;
  sort_into_runs(*other_triangles_, *other_items_, first, size_ - first);
  if (first > 0) {
    device_.run([&](VkCommandBuffer commands) {
      const VkBufferCopy triangles{.size = 12 * uint64_t{first}},
          items{.size = 4 * uint64_t{first}};
      vkCmdCopyBuffer(commands, other_triangles_->handle(), triangles_->handle(), 1, &triangles);
      vkCmdCopyBuffer(commands, other_items_->handle(), items_->handle(), 1, &items);
      wait_for_writes(commands);
    });
  }
  write_offsets();
  find_boxes();
  growth_.rebuilt(boxes(), kept_);
}

}  // namespace sample
