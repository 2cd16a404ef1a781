/* Clusters a generated grid and measures the clusters; the caller owns all memory. */
#include <math.h>

#include "example.h"

enum { COLUMNS = 200, ROWS = 100 };

static umbel_vec3 positions[(COLUMNS + 1) * (ROWS + 1)];
static uint32_t indices[COLUMNS * ROWS * 2][3];

static float hills(float x, float y) { return 5.0f * sinf(0.1f * x) * cosf(0.1f * y); }

static int show(float fraction, const char* stage, void* user) {
  (void)user;
  fprintf(stderr, "%3.0f %% %s\n", 100.0 * (double)fraction, stage);
  return 1; /* 0 would cancel */
}

int main(void) {
  make_field(COLUMNS, ROWS, (umbel_vec2){0, 0}, (umbel_vec2){COLUMNS, ROWS}, hills, positions,
             indices);

  umbel_cluster_input input;
  umbel_cluster_input_init(&input);
  input.item_count = COLUMNS * ROWS * 2;
  input.item_vertices = indices[0];
  input.vertices_per_item = 3;
  input.positions = positions;
  input.position_count = sizeof positions / sizeof *positions;

  umbel_cluster_config config;
  umbel_cluster_config_init(&config);
  check(umbel_cluster_config_preset(&config, "quality", 128));
  config.max_vertices = 128;

  /* The first call gives the largest sizes that any result can need. */
  umbel_cluster_capacity needed;
  umbel_cluster_capacity_init(&needed);
  check(umbel_cluster_requirements(&input, &config, &needed));

  umbel_cluster_output output;
  umbel_cluster_output_init(&output);
  output.ranges = malloc(needed.ranges * sizeof *output.ranges);
  output.items = malloc(needed.items * sizeof *output.items);
  if (!output.ranges || !output.items) return 1;
  output.range_capacity = needed.ranges;
  output.item_capacity = needed.items;

  /* The second call fills the arrays. */
  umbel_build_options options;
  umbel_build_options_init(&options);
  options.progress = show;
  check(umbel_cluster_build(&input, &config, &options, &output));

  umbel_cluster_metrics metrics;
  umbel_cluster_metrics_init(&metrics);
  check(umbel_cluster_get_metrics(&input, &output, config.max_items, &metrics));

  printf("%zu triangles in %zu clusters, %.1f %% full, at most %u vertices, ", output.item_count,
         output.range_count, 100 * metrics.mean_fill, metrics.max_vertices);
  printf("surface area ratio %.2f\n", metrics.surface_area_ratio);
  printf("cluster 0 has %u triangles; the first is number %u\n", output.ranges[0].count,
         output.items[output.ranges[0].offset]);

  free(output.ranges);
  free(output.items);
  return 0;
}
