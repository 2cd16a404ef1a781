#include <algorithm>
#include <cstring>
#include <string>
#include <vector>

#include "checks.hpp"
#include "deform/deforming_renderer.hpp"
#include "deform/reclusterer.hpp"

namespace sample {

namespace {

template <class T>
std::vector<T> read_back(const Device& device, const Buffer& from, size_t count) {
  const Buffer host(device, count * sizeof(T), Place::kHost);
  device.run([&](VkCommandBuffer commands) {
    const VkBufferCopy copy{.size = count * sizeof(T)};
    vkCmdCopyBuffer(commands, from.handle(), host.handle(), 1, &copy);
    wait_for_writes(commands);
  });
  const auto values = host.mapped<T>().first(count);
  return {values.begin(), values.end()};
}

template <class T>
bool same(std::span<const T> a, std::span<const T> b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size_bytes()) == 0;
}

// The very bytes of the processor's clusters, of the positions that the device has made.
bool same_as_on_host(const Device& device, const DeformingClusters& found,
                     const umbel::FrameClusterer& expected, size_t triangles) {
  const auto items = read_back<uint32_t>(device, found.items(), triangles);
  const auto corners = read_back<umbel::Triangle>(device, found.triangles(), triangles);
  return same(std::span<const uint32_t>(items), expected.items()) &&
         same(std::span<const umbel::Triangle>(corners), expected.triangles()) &&
         same(found.offsets(), expected.offsets()) && same(found.boxes(), expected.boxes()) &&
         found.growth().area_ratio == expected.area_growth().area_ratio &&
         found.growth().area_ratio_at_build == expected.area_growth().area_ratio_at_build;
}

void clusters_of(const Device& device, const umbel::Mesh& mesh, const std::string& name,
                 uint32_t max_triangles, std::unique_ptr<DeformingClusters> made = nullptr) {
  const umbel::FrameClusterConfig config{.method = umbel::FrameMethod::kMorton,
                                         .max_triangles = max_triangles};
  umbel::FrameClusterer expected(mesh.triangles, mesh.positions.size(), config);
  if (made == nullptr) made = std::make_unique<Reclusterer>(device, mesh, max_triangles);
  DeformingClusters& found = *made;
  const size_t n = mesh.triangles.size();
  uint32_t step = 0;
  bool good = true;
  for (const float time : {0.0f, 0.3f, 0.5f, 0.55f, 0.6f, 0.9f}) {
    found.deform(time);
    const auto positions = read_back<umbel::Vec3>(device, found.positions(), mesh.positions.size());
    if (step % 3 == 0) {
      found.build();
      expected.build(positions);
    } else if (step % 3 == 1) {
      found.refit();
      expected.refit(positions);
    } else {
      const uint32_t worst = std::max(found.count() / 8, 1u);
      found.rebuild_worst(worst);
      expected.rebuild_worst(positions, worst);
    }
    good &= same_as_on_host(device, found, expected, n);
    ++step;
  }
  expect(good, name + ": built, refitted and partly rebuilt, " + std::to_string(found.count()) +
                   " clusters have the bytes of the processor's");
}

double differing(std::span<const uint8_t> a, std::span<const uint8_t> b) {
  size_t pixels = 0;
  for (size_t p = 0; p < a.size(); p += 4) {
    int most = 0;
    for (size_t k = 0; k < 3; ++k) most = std::max(most, std::abs(a[p + k] - b[p + k]));
    pixels += most > 3;
  }
  return 4.0 * static_cast<double>(pixels) / static_cast<double>(a.size());
}

// Which clusters there are, and whether their structures are refitted or built, is not to be seen.
void same_pictures(const Device& device, const umbel::Mesh& mesh) {
  FrameInput input;
  input.camera.position = {1.2f, 1.0f, 2.6f};
  const umbel::RebuildPolicy keep{.threshold = 1e9}, rebuild{.threshold = 1e9, .most_period = 1},
      partly{.threshold = 1.0001, .budget = 0.2};
  DeformingRenderer kept(device, mesh, 64, 320, 240), rebuilt(device, mesh, 64, 320, 240),
      some(device, mesh, 64, 320, 240);
  double most = 0;
  uint32_t refitted = 0, built = 0;
  for (uint32_t f = 0; f < 6; ++f) {
    const float time = 0.15f * static_cast<float>(f);
    const DeformReport report = kept.draw(time, keep, input);
    rebuilt.draw(time, rebuild, input);
    const DeformReport mixed = some.draw(time, partly, input);
    if (f > 0) refitted += report.clusters - report.built;
    built += mixed.built < mixed.clusters ? mixed.built : 0;
    most = std::max({most, differing(kept.pixels(), rebuilt.pixels()),
                     differing(some.pixels(), rebuilt.pixels())});
  }
  expect(most < 0.002 && refitted > 0 && built > 0,
         "kept (" + std::to_string(refitted) + " refits) and partly rebuilt (" +
             std::to_string(built) + " builds), the picture is that of a rebuild but for " +
             std::to_string(100 * most) + " % of the pixels (at most .2)");
}

}  // namespace

void check_deform(const Device& device) {
  clusters_of(device, umbel::shapes::blob(5, 1), "blob", 64);
  clusters_of(device, umbel::shapes::blob(6, 2), "larger blob", 256);
  clusters_of(device, umbel::shapes::terrain(100, 30, 1), "terrain", 100);
  umbel::Mesh one;
  one.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  one.triangles = {{0, 1, 2}};
  clusters_of(device, one, "one triangle", 128);
  // By CUDA, where it has this device.
  const umbel::Mesh blob = umbel::shapes::blob(5, 3);
  clusters_of(device, blob, "as the device makes them", 128, make_clusters(device, blob, 128));
  same_pictures(device, umbel::shapes::blob(5, 1));
}

}  // namespace sample
