#include "query/nearest_hits.hpp"

#include <algorithm>

namespace umbel {

NearestHits::NearestHits(size_t most) : most_(most) {}
NearestHits::~NearestHits() = default;

void NearestHits::add(std::span<const Hit> hits, float& t_max) {
  hits_.insert(hits_.end(), hits.begin(), hits.end());
  if (hits_.size() < 2 * most_) return;
  keep_nearest();
  if (hits_.size() == most_) t_max = std::min(t_max, hits_.back().t);
}

size_t NearestHits::write(std::span<Hit> found) {
  keep_nearest();
  std::copy(hits_.begin(), hits_.end(), found.begin());
  return hits_.size();
}

void NearestHits::keep_nearest() {
  std::sort(hits_.begin(), hits_.end(), precedes);
  const auto are_same = [](const Hit& a, const Hit& b) { return !precedes(a, b); };
  hits_.erase(std::unique(hits_.begin(), hits_.end(), are_same), hits_.end());
  hits_.resize(std::min(hits_.size(), most_));
}

}  // namespace umbel
