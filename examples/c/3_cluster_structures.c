/* Levels of detail as GPUs take them: the inputs of cluster acceleration structures
 * (VK_NV_cluster_acceleration_structure; DXR 1.2 takes the same) and of mesh shaders
 * (VK_EXT_mesh_shader), filled from one call. Clusters have at most 128 triangles and 128 vertices,
 * positions are three floats, indices bytes. The structs are Vulkan's where its headers are there
 * and know them, else the same by hand. No GPU is needed: addresses are where the arrays would be.
 */
#include <math.h>

#include "example.h"

#if defined(__has_include)
#if __has_include(<vulkan/vulkan_core.h>)
#include <vulkan/vulkan_core.h>
#endif
#endif

#ifdef VK_NV_cluster_acceleration_structure
typedef VkClusterAccelerationStructureBuildTriangleClusterInfoNV cluster_info;
#else
typedef struct cluster_info {
  uint32_t clusterID, clusterFlags;
  uint32_t triangleCount : 9, vertexCount : 9, positionTruncateBitCount : 6, indexType : 4,
      opacityMicromapIndexType : 4;
  struct {
    uint32_t geometryIndex : 24, reserved : 5, geometryFlags : 3;
  } baseGeometryIndexAndGeometryFlags;
  uint16_t indexBufferStride, vertexBufferStride, geometryIndexAndFlagsBufferStride,
      opacityMicromapIndexBufferStride;
  uint64_t indexBuffer, vertexBuffer, geometryIndexAndFlagsBuffer, opacityMicromapArray,
      opacityMicromapIndexBuffer;
} cluster_info;
#endif
/* An array of -1 elements where the layout is another. */
typedef char cluster_info_is_64_bytes[sizeof(cluster_info) == 64 ? 1 : -1];

/* What a mesh shader reads of a cluster; workgroup i of vkCmdDrawMeshTasksEXT draws meshlet i. */
typedef struct meshlet {
  uint32_t first_vertex, first_triangle;
  uint8_t vertex_count_minus_1, triangle_count_minus_1;
  uint16_t material;
} meshlet;

enum { COLUMNS = 120, ROWS = 120, INDEX_FORMAT_8BIT = 1 };

static umbel_vec3 points[(COLUMNS + 1) * (ROWS + 1)];
static uint32_t indices[COLUMNS * ROWS * 2][3];

static float hills(float x, float y) { return 5.0f * sinf(0.1f * x) * cosf(0.1f * y); }

static void* room(size_t count, size_t size) {
  void* memory = malloc(count * size + 1);
  if (!memory) exit(1);
  return memory;
}

/* Of all clusters of all levels, in arrays that are as large as they must be. */
static void get_geometry(const umbel_lod* lod, umbel_lod_geometry* all) {
  umbel_lod_geometry_init(all);
  check(umbel_lod_get_geometry(lod, NULL, 0, NULL, all));
  all->cluster_capacity = all->cluster_count;
  all->vertex_capacity = all->vertex_count;
  all->triangle_capacity = all->triangle_count;
  all->vertex_offsets = room(all->cluster_count + 1, sizeof *all->vertex_offsets);
  all->triangle_offsets = room(all->cluster_count + 1, sizeof *all->triangle_offsets);
  all->materials = room(all->cluster_count, sizeof *all->materials);
  all->positions = room(all->vertex_count, sizeof *all->positions);
  all->source_vertices = room(all->vertex_count, sizeof *all->source_vertices);
  all->triangles = room(all->triangle_count, 3);
  check(umbel_lod_get_geometry(lod, NULL, 0, NULL, all));
}

static void fill(const umbel_lod_geometry* all, uint64_t position_address, uint64_t index_address,
                 cluster_info* infos, meshlet* meshlets) {
  for (size_t i = 0; i < all->cluster_count; ++i) {
    const uint32_t vertex = all->vertex_offsets[i], triangle = all->triangle_offsets[i];
    const uint32_t vertices = all->vertex_offsets[i + 1] - vertex;
    const uint32_t triangles = all->triangle_offsets[i + 1] - triangle;
    memset(&infos[i], 0, sizeof infos[i]);
    infos[i].clusterID = (uint32_t)i;
    infos[i].triangleCount = triangles & 0x1ff;
    infos[i].vertexCount = vertices & 0x1ff;
    infos[i].indexType = INDEX_FORMAT_8BIT;
    infos[i].baseGeometryIndexAndGeometryFlags.geometryIndex = all->materials[i] & 0xffffff;
    infos[i].vertexBufferStride = sizeof(umbel_vec3);
    infos[i].indexBufferStride = 1;
    infos[i].vertexBuffer = position_address + (uint64_t)vertex * sizeof(umbel_vec3);
    infos[i].indexBuffer = index_address + 3 * (uint64_t)triangle;
    meshlets[i].first_vertex = vertex;
    meshlets[i].first_triangle = triangle;
    meshlets[i].vertex_count_minus_1 = (uint8_t)(vertices - 1);
    meshlets[i].triangle_count_minus_1 = (uint8_t)(triangles - 1);
    meshlets[i].material = (uint16_t)all->materials[i];
  }
}

int main(void) {
  make_field(COLUMNS, ROWS, (umbel_vec2){0, 0}, (umbel_vec2){COLUMNS, ROWS}, hills, points,
             indices);
  umbel_lod_mesh mesh;
  umbel_lod_mesh_init(&mesh);
  mesh.positions = points;
  mesh.position_count = sizeof points / sizeof *points;
  mesh.triangles = indices[0];
  mesh.triangle_count = COLUMNS * ROWS * 2;
  umbel_lod* lod;
  check(umbel_lod_build(&mesh, NULL, NULL, &lod));

  umbel_lod_geometry all;
  get_geometry(lod, &all);
  cluster_info* infos = room(all.cluster_count, sizeof *infos);
  meshlet* meshlets = room(all.cluster_count, sizeof *meshlets);
  /* A GPU would have these where its buffers are: vkGetBufferDeviceAddress. */
  fill(&all, 0x10000000u, 0x20000000u, infos, meshlets);

  /* What to build and draw each frame: the clusters of a cut. */
  umbel_lod_view view;
  umbel_lod_budget budget;
  uint32_t offsets[2];
  size_t count;
  umbel_lod_budget_init(&budget);
  budget.unit = UMBEL_LOD_CLUSTERS;
  budget.limit = 100;
  check(umbel_lod_view_error(0, &view));
  uint32_t* cut = room(budget.limit, sizeof *cut);
  check(umbel_lod_select_for_budget(umbel_lod_get_tables(lod), &view, &budget, NULL, NULL, 0,
                                    offsets, cut, budget.limit, &count, NULL));
  size_t triangles = 0, own = 0;
  for (size_t i = 0; i < count; ++i) triangles += infos[cut[i]].triangleCount;
  for (size_t v = 0; v < all.vertex_count; ++v) own += all.source_vertices[v] != UMBEL_NONE;
  printf("%zu clusters, %zu vertices (%zu of the source), %zu triangles in %zu bytes\n",
         all.cluster_count, all.vertex_count, own, all.triangle_count,
         all.vertex_count * sizeof(umbel_vec3) + 3 * all.triangle_count);
  printf("a cut of at most 100 clusters has %zu with %zu triangles; cluster %u is at 0x%llx\n",
         count, triangles, cut[0], (unsigned long long)infos[cut[0]].vertexBuffer);

  free(cut);
  free(meshlets);
  free(infos);
  free(all.triangles);
  free(all.source_vertices);
  free(all.positions);
  free(all.materials);
  free(all.triangle_offsets);
  free(all.vertex_offsets);
  umbel_lod_free(lod);
  return count <= 100 && triangles > 0 ? 0 : 1;
}
