// Clusters a mesh and measures the clusters.
#include <cstdio>
#include <umbel/umbel.hpp>

int main() {
  const umbel::Mesh mesh = umbel::shapes::blob(6, 1);
  const umbel::MeshView view = mesh.view();

  const umbel::ClusterConfig config = umbel::cluster_preset("quality", 128);
  const umbel::Clusters clusters = umbel::cluster_mesh(view, config);

  const std::vector<umbel::Aabb> boxes = umbel::triangle_boxes(view);
  umbel::ClusterInput input;
  input.boxes = boxes;
  const umbel::ClusterMetrics metrics = umbel::cluster_metrics(input, clusters, config.max_items);
  std::printf("%zu triangles in %zu clusters, %.1f %% full, surface area ratio %.2f\n",
              mesh.triangles.size(), metrics.clusters, 100 * metrics.mean_fill,
              metrics.surface_area_ratio);
}
