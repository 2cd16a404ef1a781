// Verifying a DAG: that every cut of it is one surface, whoever built or stored it.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "umbel/lod/types.hpp"
#include "umbel/types.hpp"

namespace umbel::lod {

/// Throws kCorrupt, naming the first fault, unless every index in the tables leads to what it
/// should. Tables that the library built or read from a file need no check.
UMBEL_API void validate(const Tables& tables);

struct VerifyConfig {
  uint32_t cuts = 64;  ///< random cuts: half by error, half by camera from inside and outside
  uint32_t seed = 1;
  uint32_t max_triangles = 256, max_vertices = 256;  ///< limits that the asset claims
  uint64_t source_triangles = 0, source_digest = 0;  ///< of the mesh that it was built from
};

struct VerifyReport {
  bool ok = true;
  uint32_t cuts = 0;
  uint64_t cracks = 0;    ///< edges of a cut, or of a group's border, that are open and not allowed
  uint64_t overlaps = 0;  ///< edges of a cut with more triangles than the input allows
  uint64_t limit_violations = 0;      ///< clusters over a limit, indices out of range, bad links
  bool monotone = true;               ///< errors and spheres never shrink towards the root
  uint64_t checksum_errors = 0;       ///< filled in by verify_asset
  std::vector<std::string> problems;  ///< a sentence each, the first 32
};

/// Checks the tables, the size limits, that errors and spheres are monotone, that level 0 is the
/// source, that simplification kept every group's border, and random cuts. An edge (a pair of
/// positions) of a cut is good if two triangles share it; any other is allowed if its ends are
/// joined by non-manifold edges of the source: those that not exactly two triangles share, or that
/// two share running in the same direction (duplicates, surfaces without orientation); or by such
/// edges between new positions of what a group of SimplifyMethod::kSloppy was simplified to
/// (enlarged components). Borders of groups are compared side by side where the source has no
/// non-manifold edge, else modulo 2.
UMBEL_API VerifyReport verify(const Tables& tables, const GeometryReader& geometry,
                              const VerifyConfig& config, const BuildOptions& options = {});

}  // namespace umbel::lod
