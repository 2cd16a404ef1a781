// The nearest hits of a ray that has many.
#pragma once

#include <span>
#include <vector>

#include "umbel/triangle_queries.hpp"

namespace umbel {

/// Sorts now and then, so that the time for n hits is that of sorting them, in whatever order they
/// come. Nothing here is inlined, since it is used by files of every instruction set.
class NearestHits {
 public:
  /// Of the most hits that are wanted.
  explicit NearestHits(size_t most);
  ~NearestHits();
  NearestHits(const NearestHits&) = delete;
  NearestHits& operator=(const NearestHits&) = delete;

  /// May lower t_max, beyond which no hit counts any more. Hits may be added repeatedly.
  void add(std::span<const Hit> hits, float& t_max);
  /// Writes the hits in the order of (t, primitive), each triangle once. Returns how many.
  size_t write(std::span<Hit> found);

 private:
  void keep_nearest();

  size_t most_;
  std::vector<Hit> hits_;
};

}  // namespace umbel
