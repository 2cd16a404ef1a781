// Anything that traces single rays.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "clocks.hpp"
#include "mesh_reader.hpp"
#include "view_rays.hpp"

namespace bench {

/// Like is compared with like.
enum class Kind { kPlain, kSpatialSplits, kShown };

/// Anything that traces: built a few times, then traced many times.
struct Tracer {
  std::string name;
  Kind kind = Kind::kShown;
  bool is_ours = false;
  double build_seconds = 0;
  double bytes_per_triangle = 0;
  std::function<void(const std::vector<Ray>&, std::vector<Hit>&)> trace;
  std::vector<double> primary, bounce;
};

}  // namespace bench
