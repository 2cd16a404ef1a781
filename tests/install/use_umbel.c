/* A user's program in C: clusters by the two calls, an error as a code and a sentence. */
#include <stdio.h>
#include <umbel/umbel.h>

enum { COUNT = 1000 };

static umbel_aabb boxes[COUNT];
static umbel_range ranges[COUNT];
static uint32_t items[COUNT];

int main(void) {
  umbel_cluster_input input;
  umbel_cluster_config config;
  umbel_cluster_output output;
  umbel_cluster_capacity needed;
  umbel_cluster_metrics metrics;
  umbel_result missing;
  for (int i = 0; i < COUNT; ++i) {
    boxes[i].min.x = (float)(i * 7919 % COUNT);
    boxes[i].max.x = boxes[i].min.x + 1;
    boxes[i].max.y = boxes[i].max.z = 1;
  }
  umbel_cluster_input_init(&input);
  umbel_cluster_config_init(&config);
  umbel_cluster_output_init(&output);
  umbel_cluster_capacity_init(&needed);
  umbel_cluster_metrics_init(&metrics);
  input.boxes = boxes;
  input.item_count = COUNT;
  output.ranges = ranges;
  output.range_capacity = COUNT;
  output.items = items;
  output.item_capacity = COUNT;
  if (umbel_cluster_requirements(&input, &config, &needed) != UMBEL_OK || needed.ranges > COUNT ||
      needed.items != COUNT || umbel_cluster_build(&input, &config, NULL, &output) != UMBEL_OK ||
      umbel_cluster_get_metrics(&input, &output, config.max_items, &metrics) != UMBEL_OK) {
    fprintf(stderr, "%s\n", umbel_last_error());
    return 1;
  }
  input.boxes = NULL;
  missing = umbel_cluster_build(&input, &config, NULL, &output);
  printf("umbel %s from C: %zu clusters of %u to %u; %s: %s\n", umbel_version(), metrics.clusters,
         metrics.min_size, metrics.max_size, umbel_result_name(missing), umbel_last_error());
  return metrics.clusters > 0 && metrics.max_size <= config.max_items &&
                 missing == UMBEL_ERROR_INVALID_ARGUMENT && umbel_last_error()[0]
             ? 0
             : 1;
}
