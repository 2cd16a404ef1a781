// What every part of Umbel's C interface shares: results, errors, how structs grow, vectors, boxes,
// and the options that every build takes. C99; no exception leaves it.
//
// The library keeps no pointer after a call has returned, unless a function says so, and owns no
// memory that it gave out. Every function may be called from any number of threads at once. The
// same input and config give the same bytes for any number of threads.
#ifndef UMBEL_UMBEL_BASE_H
#define UMBEL_UMBEL_BASE_H

#include <stddef.h>
#include <stdint.h>
#include <string.h>

#if defined(UMBEL_SHARED) && defined(_WIN32)
#if defined(UMBEL_EXPORTS)
#define UMBEL_C_API __declspec(dllexport)
#else
#define UMBEL_C_API __declspec(dllimport)
#endif
#elif defined(__GNUC__)
#define UMBEL_C_API __attribute__((visibility("default")))
#else
#define UMBEL_C_API
#endif

#ifdef __cplusplus
extern "C" {
#endif

// ---- results -----------------------------------------------------------------------------------

typedef enum umbel_result {
  UMBEL_OK = 0,
  UMBEL_ERROR_INVALID_ARGUMENT = 1,  ///< a config value, a size or a combination that cannot be met
  UMBEL_ERROR_INVALID_MESH = 2,      ///< NaN, infinity or an index out of range in the geometry
  UMBEL_ERROR_IO = 3,                ///< a file cannot be opened, read or written
  UMBEL_ERROR_CORRUPT = 4,           ///< bytes of a file, or tables, are not what they should be
  UMBEL_ERROR_UNSUPPORTED = 5,       ///< valid, but more than this version of the library can do
  UMBEL_ERROR_CANCELLED = 6,         ///< a callback asked to stop
  UMBEL_ERROR_CAPACITY = 7,          ///< an output array is too small; its count says what it needs
  UMBEL_ERROR_OUT_OF_MEMORY = 8,
  UMBEL_ERROR_INTERNAL = 9,  ///< a fault of the library itself
  UMBEL_ERROR_DEVICE = 10    ///< a call of CUDA failed; the sentence ends with CUDA's own words
} umbel_result;

/// One sentence about this thread's last call that failed, naming the argument, the index and the
/// value; "" before the first. Valid until the thread's next failure; never NULL.
UMBEL_C_API const char* umbel_last_error(void);

/// The name of a result, as "invalid argument"; "unknown result" for any other number.
UMBEL_C_API const char* umbel_result_name(umbel_result result);

/// The library's version, as "0.1.0".
UMBEL_C_API const char* umbel_version(void);

// ---- structs -----------------------------------------------------------------------------------
//
// Each struct that starts with `struct_size` must go through its init function before anything
// else. That field tells the library which version of the struct it was given, so that a program
// works with a newer library (fields it does not know keep their defaults), and with an older one
// as long as what that does not know is zero (UMBEL_ERROR_UNSUPPORTED otherwise). Other languages
// set `struct_size` to the struct's size and all else to zero, and call the _init_sized function of
// configs (umbel_ray_options.mask: all ones), whose defaults are not.

/// Defines name_init(name*), which sets everything to zero and `struct_size` to the struct's size.
#define UMBEL_STRUCT_INIT(name)                   \
  static inline void name##_init(name* value) {   \
    memset(value, 0, sizeof *value);              \
    value->struct_size = (uint32_t)sizeof *value; \
  }

typedef struct umbel_vec2 {
  float x, y;
} umbel_vec2;

typedef struct umbel_vec3 {
  float x, y, z;
} umbel_vec3;

typedef struct umbel_vec4 {
  float x, y, z, w;
} umbel_vec4;

/// A point of the world, in double precision.
typedef struct umbel_vec3d {
  double x, y, z;
} umbel_vec3d;

/// A point of the world relative to `origin` (umbel_asset_info.origin), as views, rays and
/// positions are: subtracted in double precision, then rounded.
static inline umbel_vec3 umbel_relative_to(umbel_vec3d origin, umbel_vec3d point) {
  umbel_vec3 local;
  local.x = (float)(point.x - origin.x);
  local.y = (float)(point.y - origin.y);
  local.z = (float)(point.z - origin.z);
  return local;
}

typedef struct umbel_aabb {
  umbel_vec3 min, max;
} umbel_aabb;

typedef struct umbel_sphere {
  umbel_vec3 center;
  float radius;
} umbel_sphere;

/// The points with dot(normal, p) + offset >= 0.
typedef struct umbel_plane {
  umbel_vec3 normal;
  float offset;
} umbel_plane;

/// The half-open index range [offset, offset + count).
typedef struct umbel_range {
  uint32_t offset, count;
} umbel_range;

/// An affine map: three rows of four, x' = rows[0] x + rows[1] y + rows[2] z + rows[3], and so on.
typedef struct umbel_transform {
  float rows[12];
} umbel_transform;

/// "No such element", where an index is optional: no triangle was hit, no group was simplified.
#define UMBEL_NONE 0xffffffffu

/// "No limit", in every setting that limits a whole number: triangles, vertices, levels, bytes.
/// UMBEL_NONE says the same. Where a comment gives a range without 0, or another meaning of 0, that
/// holds instead. Settings that are floats have no limit where they are INFINITY.
#define UMBEL_NO_LIMIT 0u

// ---- builds ------------------------------------------------------------------------------------

/// Called from the thread that called the build, with the fraction done in [0, 1] (it never falls)
/// and the name of the stage. Return nonzero to go on, 0 to cancel.
typedef int (*umbel_progress)(float fraction, const char* stage, void* user);

/// Called at the end of a build that times its stages, once a stage, with seconds by the wall
/// clock. umbel_bvh2_build and umbel_bvh2_build_triangles do by k-means: "boxes", "seeding",
/// "iterations", "sizes", "reordering" and "agglomeration".
typedef void (*umbel_stage_observer)(const char* stage, double seconds, void* user);

/// What every build takes. None of it changes the result.
typedef struct umbel_build_options {
  uint32_t struct_size;
  uint32_t threads;                     ///< most threads to use; 0: all cores
  umbel_progress progress;              ///< NULL: none
  void* progress_user;                  ///< passed to `progress`
  umbel_stage_observer stage_observer;  ///< NULL: none
  void* stage_user;                     ///< passed to `stage_observer`
} umbel_build_options;

UMBEL_STRUCT_INIT(umbel_build_options)
#ifdef __cplusplus
}
#endif

#endif  // UMBEL_UMBEL_BASE_H
