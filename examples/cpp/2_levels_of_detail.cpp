// Builds a continuous-LOD asset, verifies it, and selects cuts from growing distances.
#include <cstdio>
#include <string>
#include <umbel/umbel.hpp>

int main(int argc, char** argv) try {
  const std::string path = argc > 1 ? argv[1] : "blob.umbel";
  const umbel::Mesh mesh = umbel::shapes::blob(6, 1);

  umbel::BuildOptions options;
  options.progress = [](float fraction, std::string_view stage) {
    std::fprintf(stderr, "\r%3.0f %% %.*s   ", 100 * fraction, static_cast<int>(stage.size()),
                 stage.data());
    return true;  // false would cancel
  };
  const umbel::lod::Dag dag = umbel::lod::build(mesh.view(), {}, options);
  std::fprintf(stderr, "\n");
  umbel::write_asset(path, dag);

  const umbel::lod::VerifyReport report = umbel::verify_asset(path);
  std::printf("verified with %u cuts: %s\n", report.cuts, report.ok ? "ok" : "not ok");

  const umbel::Asset asset(path);
  for (const float distance : {2.0f, 10.0f, 50.0f, 250.0f}) {
    const auto view = umbel::lod::view_camera({0, 0, distance}, 1.0f, 1080, 1.0f);
    const auto cut = umbel::lod::select_hierarchy(asset.tables(), view);
    const umbel::Mesh shown = umbel::lod::mesh_of_cut(
        asset.tables(), [&](uint32_t cluster) { return asset.geometry(cluster); }, cut);
    std::printf("seen from %.0f: %zu triangles in %zu clusters\n", distance, shown.triangles.size(),
                cut.size());
  }
  return report.ok ? 0 : 1;
} catch (const umbel::Error& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
