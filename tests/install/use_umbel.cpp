// A user's program, through every public header: a mesh to clusters, to levels of detail, to a
// file and back to a cut, and an error caught across the library's border.
#include <cstdio>
#include <filesystem>
#include <umbel/umbel.hpp>

int main() {
  const umbel::Mesh sphere = umbel::shapes::sphere(5);
  const umbel::Clusters clusters = umbel::cluster_mesh(sphere.view(), umbel::ClusterConfig{});
  const umbel::lod::Dag dag = umbel::lod::build(sphere.view());

  const auto path = std::filesystem::temp_directory_path() / "umbel_install_test.umbel";
  const uint64_t bytes = umbel::write_asset(path, dag);
  size_t triangles = 0;
  bool ok = false;
  {
    const umbel::Asset asset(path);
    const float error = umbel::lod::error_for_triangles(asset.tables(), 2000);
    const auto cut = umbel::lod::select(asset.tables(), umbel::lod::view_error(error));
    const auto geometry = [&](uint32_t cluster) { return asset.geometry(cluster); };
    triangles = umbel::lod::mesh_of_cut(asset.tables(), geometry, cut).triangles.size();
    ok = umbel::verify_asset(path, 4).ok;
  }
  std::filesystem::remove(path);

  bool caught = false;
  try {
    const umbel::Asset missing(path);
  } catch (const umbel::Error& error) {
    caught = error.code() == umbel::ErrorCode::kIo;
  }
  std::printf("umbel %s: %zu triangles, %zu clusters, %llu bytes, a cut of %zu, %s, %s\n",
              UMBEL_VERSION, sphere.triangles.size(), clusters.ranges.size(),
              static_cast<unsigned long long>(bytes), triangles, ok ? "verified" : "not verified",
              caught ? "error caught" : "error lost");
  return ok && caught && triangles > 0 && triangles <= 2000 ? 0 : 1;
}
