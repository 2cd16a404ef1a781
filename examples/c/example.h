/* What the examples share: a mesh to work on, and the end where a call fails. */
#ifndef UMBEL_EXAMPLE_H
#define UMBEL_EXAMPLE_H

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <umbel/umbel.h>

static void check(umbel_result result) {
  if (result == UMBEL_OK) return;
  fprintf(stderr, "%s: %s\n", umbel_result_name(result), umbel_last_error());
  exit(1);
}

/* A field of `columns` by `rows` squares, two triangles each, from `low` on. */
static void make_field(uint32_t columns, uint32_t rows, umbel_vec2 low, umbel_vec2 size,
                       float (*height)(float, float), umbel_vec3* points,
                       uint32_t (*triangles)[3]) {
  for (uint32_t row = 0; row <= rows; ++row)
    for (uint32_t column = 0; column <= columns; ++column, ++points) {
      points->x = low.x + size.x * (float)column / (float)columns;
      points->y = low.y + size.y * (float)row / (float)rows;
      points->z = height(points->x, points->y);
    }
  for (uint32_t row = 0; row < rows; ++row)
    for (uint32_t column = 0; column < columns; ++column, triangles += 2) {
      const uint32_t v = row * (columns + 1) + column, above = v + columns + 1;
      const uint32_t two[2][3] = {{v, v + 1, above}, {v + 1, above + 1, above}};
      memcpy(triangles, two, sizeof two);
    }
}

#endif
