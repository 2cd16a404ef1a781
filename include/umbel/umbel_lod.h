// Continuous level of detail from C: building it, and selecting what to draw. C99.
//
//   umbel_lod_mesh mesh;
//   umbel_lod_mesh_init(&mesh);
//   mesh.positions = positions;
//   mesh.position_count = vertex_count;
//   mesh.triangles = indices;
//   mesh.triangle_count = triangle_count;
//
//   umbel_lod* lod;
//   if (umbel_lod_build(&mesh, NULL, NULL, &lod) != UMBEL_OK) puts(umbel_last_error());
//
//   umbel_lod_view view;
//   umbel_lod_view_camera(eye, fov_y, height, pixel_error, &view);
//   size_t count;
//   umbel_lod_select(umbel_lod_get_tables(lod), &view, NULL, UMBEL_LOD_HIERARCHY, NULL, 0, &count);
//   uint32_t* cut = malloc(count * sizeof *cut);
//   umbel_lod_select(umbel_lod_get_tables(lod), &view, NULL, UMBEL_LOD_HIERARCHY, cut, count,
//                    &count);
//   umbel_lod_free(lod);
//
// docs/lod.md explains what is built; docs/selection.md specifies what is selected, to the last
// bit. Objects and their arrays live until the matching _free. Any number of threads may use the
// same object at once.
#ifndef UMBEL_UMBEL_LOD_H
#define UMBEL_UMBEL_LOD_H

#include "umbel/umbel_lod_build.h"
#include "umbel/umbel_lod_select.h"

#endif  // UMBEL_UMBEL_LOD_H
