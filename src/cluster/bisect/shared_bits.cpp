#include "cluster/bisect/shared_bits.hpp"

namespace umbel::cluster {

void SharedBits::load(const Source& source, const uint32_t* items, uint32_t count) {
  const Connections& c = source.connections;
  active_ = !source.vertices && source.arity > 0;
  if (!active_) return;
  arity_ = source.arity;
  bits_.clear();
  connections_.load(c, items, count, [&](uint32_t k) { bits_.push_back(c.vertex_bits[k]); });
  stamps_.assign(count, 0);
  stamp_ = 0;
}

}  // namespace umbel::cluster
