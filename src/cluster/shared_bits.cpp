#include "cluster/shared_bits.hpp"

namespace umbel::cluster {

void SharedBits::load(const Source& source, const uint32_t* items, uint32_t count) {
  const Connections& c = source.connections;
  active_ = !source.vertices && source.arity > 0;
  if (!active_) return;
  arity_ = source.arity;
  if (local_of_.size() < c.ranges.size()) local_of_.resize(c.ranges.size());
  for (uint32_t i = 0; i < count; ++i) local_of_[items[i]] = i;
  offsets_.assign(1, 0);
  targets_.clear();
  bits_.clear();
  for (uint32_t i = 0; i < count; ++i) {
    const Range& r = c.ranges[items[i]];
    for (uint32_t k = r.offset; k < r.offset + r.count; ++k) {
      const uint32_t local = local_of_[c.targets[k]];
      if (local >= count || items[local] != c.targets[k] || local == i) continue;
      targets_.push_back(local);
      bits_.push_back(c.vertex_bits[k]);
    }
    offsets_.push_back(static_cast<uint32_t>(targets_.size()));
  }
  stamps_.assign(count, 0);
  stamp_ = 0;
}

}  // namespace umbel::cluster
