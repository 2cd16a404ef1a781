/* Rays against a generated hill: an ASCII picture with shadows, and the closest point. */
#include <math.h>

#include "example.h"

enum { SIDE = 100, WIDTH = 64, HEIGHT = 24 };

static umbel_vec3 positions[(SIDE + 1) * (SIDE + 1)];
static uint32_t indices[SIDE * SIDE * 2][3];
static umbel_ray rays[WIDTH * HEIGHT], shadow_rays[WIDTH * HEIGHT];
static umbel_hit hits[WIDTH * HEIGHT];
static uint8_t in_shadow[WIDTH * HEIGHT];

static float hill(float x, float y) { return expf(-6.0f * (x * x + y * y)); }

/* Rays straight down, one per character. */
static void aim(void) {
  for (int y = 0; y < HEIGHT; ++y) {
    for (int x = 0; x < WIDTH; ++x) {
      umbel_ray* ray = &rays[y * WIDTH + x];
      ray->origin.x = 2.0f * ((float)x + 0.5f) / WIDTH - 1.0f;
      ray->origin.y = 1.0f - 2.0f * ((float)y + 0.5f) / HEIGHT;
      ray->origin.z = 5.0f;
      ray->direction.z = -1.0f;
      ray->t_max = INFINITY;
    }
  }
}

/* Rays from the hits towards a low sun. */
static void aim_at_sun(void) {
  for (int i = 0; i < WIDTH * HEIGHT; ++i) {
    umbel_ray* ray = &shadow_rays[i];
    ray->origin = rays[i].origin;
    ray->origin.z += rays[i].direction.z * hits[i].t;
    ray->direction.x = 1.0f;
    ray->direction.z = 0.3f;
    ray->t_min = 1e-3f; /* skips the surface itself */
    ray->t_max = INFINITY;
  }
}

int main(void) {
  make_field(SIDE, SIDE, (umbel_vec2){-1, -1}, (umbel_vec2){2, 2}, hill, positions, indices);
  umbel_bvh_mesh mesh;
  umbel_bvh_mesh_init(&mesh);
  mesh.positions = positions;
  mesh.position_count = sizeof positions / sizeof *positions;
  mesh.triangles = indices[0];
  mesh.triangle_count = SIDE * SIDE * 2;

  umbel_bvh_config config;
  umbel_bvh_config_init(&config);
  check(umbel_bvh_config_preset(&config, "quality"));

  umbel_bvh* bvh = NULL;
  check(umbel_bvh_build(&mesh, &config, NULL, &bvh));
  umbel_bvh_statistics statistics;
  umbel_bvh_statistics_init(&statistics);
  check(umbel_bvh_get_statistics(bvh, &statistics));
  printf("%u triangles, %u nodes, SAH cost %.1f, %.1f bytes a triangle\n",
         statistics.triangle_count, statistics.nodes, statistics.sah_cost,
         (double)statistics.bytes / statistics.triangle_count);

  aim();
  check(umbel_bvh_intersect(bvh, rays, WIDTH * HEIGHT, NULL, hits));
  aim_at_sun();
  check(umbel_bvh_occluded(bvh, shadow_rays, WIDTH * HEIGHT, NULL, in_shadow));
  for (int y = 0; y < HEIGHT; ++y) {
    for (int x = 0; x < WIDTH; ++x) {
      const int i = y * WIDTH + x;
      putchar(hits[i].primitive == UMBEL_NONE ? ' ' : in_shadow[i] ? '.' : '#');
    }
    putchar('\n');
  }

  const umbel_vec3 point = {0.5f, 0.0f, 1.0f};
  umbel_closest_point nearest;
  check(umbel_bvh_closest_point(bvh, &point, 1, INFINITY, 0, &nearest));
  printf("the surface is %.3f away, on triangle %u\n", (double)nearest.distance, nearest.primitive);

  umbel_bvh_free(bvh);
  return 0;
}
