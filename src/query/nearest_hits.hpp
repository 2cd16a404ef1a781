// The nearest hits of a ray that has many.
#pragma once

#include <span>
#include <vector>

#include "umbel/triangle_queries.hpp"

namespace umbel {

/// In the order of (t, primitive).
static inline bool precedes(const Hit& a, const Hit& b) {
  return a.t != b.t ? a.t < b.t : a.primitive < b.primitive;
}

/// Sorts now and then, so that the time for n hits is that of sorting them, in whatever order they
/// come. No member is inlined, since files of every instruction set use it.
class NearestHits {
 public:
  /// Of the most hits that are wanted.
  explicit NearestHits(size_t most);
  ~NearestHits();
  NearestHits(const NearestHits&) = delete;
  NearestHits& operator=(const NearestHits&) = delete;

  /// May lower t_max, beyond which no hit counts any more. Hits may be added repeatedly.
  void add(std::span<const Hit> hits, float& t_max);
  /// Writes the hits in their order, each triangle once. Returns how many.
  size_t write(std::span<Hit> found);

 private:
  void keep_nearest();

  size_t most_;
  std::vector<Hit> hits_;
};

}  // namespace umbel
