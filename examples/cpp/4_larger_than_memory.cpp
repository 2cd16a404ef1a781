// Builds an asset of a mesh that is never in memory as a whole: a terrain that is made block by
// block. Units of it are built side by side, each by this program in a process of its own.
//
//   4_larger_than_memory [OUTPUT.umbel [VERTICES ALONG A SIDE]]
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <string_view>
#include <umbel/umbel.hpp>

namespace {

class Terrain final : public umbel::TriangleSource {
 public:
  explicit Terrain(uint64_t side) : squares_(side - 1) {}

  uint64_t triangles() const override { return 2 * squares_ * squares_; }

  umbel::TriangleBlock read(uint64_t begin, uint64_t end) const override {
    umbel::TriangleBlock block;
    for (uint64_t triangle = begin; triangle < end; ++triangle) {
      const uint64_t x = triangle / 2 % squares_, y = triangle / 2 / squares_;
      // Vertices that triangles share may be given again and again, with the same bits.
      const auto first = static_cast<uint32_t>(block.positions.size());
      block.positions.push_back(point(x + 1, y));
      block.positions.push_back(point(x, y + 1));
      block.positions.push_back(triangle % 2 == 0 ? point(x, y) : point(x + 1, y + 1));
      const uint32_t second = triangle % 2 == 0 ? 1 : 2, third = 3 - second;
      block.triangles.push_back({first, first + second, first + third});
    }
    return block;
  }

 private:
  static umbel::Vec3d point(uint64_t x, uint64_t y) {
    const auto u = static_cast<double>(x), v = static_cast<double>(y);
    return {u, v, 20 * std::sin(u / 50) * std::cos(v / 70) + std::sin(u / 3 + v / 4)};
  }

  uint64_t squares_;
};

}  // namespace

int main(int argc, char** argv) try {
  if (argc > 1 && argv[1] == std::string_view("--unit")) return umbel::run_unit_worker(argc, argv);
  const std::string path = argc > 1 ? argv[1] : "terrain.umbel";
  const Terrain terrain(argc > 2 ? std::strtoull(argv[2], nullptr, 10) : 200);

  umbel::UnitsConfig config;
  config.work = path + ".work";
  config.resume = true;            // goes on with what an earlier run has left, if there is any
  config.unit_triangles = 20'000;  // leave this as it is for real meshes
  config.memory_bytes = 2'000'000'000;
  config.worker = {argv[0], "--unit"};
  umbel::BuildOptions options;
  options.progress = [](float fraction, std::string_view stage) {
    std::fprintf(stderr, "\r%3.0f %% %.*s   ", static_cast<double>(100 * fraction),
                 static_cast<int>(stage.size()), stage.data());
    return true;
  };
  const umbel::UnitsReport report = umbel::build_in_units(path, terrain, config, options);
  std::printf("\n%llu triangles, %u clusters on %u levels, %u workers\n",
              static_cast<unsigned long long>(report.lod.input_triangles), report.clusters,
              report.levels, report.workers);
  const bool ok = umbel::verify_asset_within(config.memory_bytes, path).ok;
  std::printf("verified: %s\n", ok ? "ok" : "not ok");
  return ok ? 0 : 1;
} catch (const umbel::Error& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
