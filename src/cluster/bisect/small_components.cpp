// Union-find with path halving (Tarjan and van Leeuwen, "Worst-case analysis of set union
// algorithms", 1984).
#include "cluster/bisect/small_components.hpp"

#include <algorithm>

namespace umbel::cluster {

// The lowest item of its component so far.
uint32_t SmallComponents::first_of(uint32_t item) {
  while (parents_[item] != item) item = parents_[item] = parents_[parents_[item]];
  return item;
}

std::span<const uint32_t> SmallComponents::find(std::span<const uint32_t> numbers, uint32_t arity,
                                                size_t vertex_count, uint32_t most) {
  const uint32_t count = static_cast<uint32_t>(numbers.size() / arity);
  parents_.resize(count);
  sizes_.assign(count, 1);
  users_.assign(vertex_count, kNone);
  for (uint32_t i = 0; i < count; ++i) {
    uint32_t own = parents_[i] = i;
    for (uint32_t k = 0; k < arity; ++k) {
      uint32_t& user = users_[numbers[size_t(i) * arity + k]];
      const uint32_t other = user == kNone ? own : first_of(user);
      user = i;
      if (other == own) continue;
      const auto [low, high] = std::minmax(own, other);
      parents_[high] = low;
      sizes_[low] += sizes_[high];
      own = low;
    }
  }
  firsts_.resize(count);
  for (uint32_t i = 0; i < count; ++i) {
    const uint32_t first = first_of(i);
    firsts_[i] = sizes_[first] <= most ? first : i;
  }
  return firsts_;
}

}  // namespace umbel::cluster
