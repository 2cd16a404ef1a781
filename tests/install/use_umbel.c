/* A user's program in C: clusters by the two calls, a tree that a function of the program looks
   through, an error as a code and a sentence. */
#include <stdio.h>
#include <umbel/umbel.h>

enum { COUNT = 1000 };

static umbel_aabb boxes[COUNT];
static umbel_range ranges[COUNT];
static uint32_t items[COUNT];

/* Of a ray through all boxes; the second ends it. */
static float count_box(void* user, uint32_t box) {
  uint32_t* seen = user;
  seen[0] += 1;
  seen[1] = box;
  return seen[0] == 2 ? -1.0f : 1e30f;
}

static int rays_work(void) {
  umbel_dynamic_tree* tree;
  umbel_ray ray = {{-1, 0.5f, 0.5f}, 0, {1, 0, 0}, 1e30f};
  uint32_t seen[2] = {0, 0}, last = 0;
  int done;
  if (umbel_dynamic_tree_build(boxes, COUNT, NULL, NULL, &tree) != UMBEL_OK) return 0;
  done = umbel_dynamic_tree_insert(tree, &boxes[0], &last) == UMBEL_OK && last == COUNT &&
         umbel_dynamic_tree_remove(tree, 0) == UMBEL_OK &&
         umbel_dynamic_tree_traverse_ray(tree, &ray, count_box, seen, NULL) == UMBEL_OK &&
         seen[0] == 2 && umbel_dynamic_tree_contains(tree, seen[1]);
  umbel_dynamic_tree_free(tree);
  return done;
}

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
      umbel_cluster_get_metrics(&input, &output, config.max_items, &metrics) != UMBEL_OK ||
      !rays_work()) {
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
