#include "io/source/vertex_numbers.hpp"

#include <algorithm>

#include "umbel/types.hpp"

namespace umbel::io {

std::vector<uint32_t> number_vertices(std::vector<uint32_t>& indices) {
  if (indices.empty()) return {};
  const auto [low, high] = std::minmax_element(indices.begin(), indices.end());
  const uint32_t first = *low;
  const size_t range = size_t{*high} - first + 1;
  std::vector<uint32_t> used;
  if (range <= 4 * indices.size() + 1024) {
    std::vector<uint32_t> number(range, kNone);
    for (uint32_t v : indices) number[v - first] = 0;
    for (size_t k = 0; k < range; ++k) {
      if (number[k] == kNone) continue;
      number[k] = static_cast<uint32_t>(used.size());
      used.push_back(static_cast<uint32_t>(first + k));
    }
    for (uint32_t& v : indices) v = number[v - first];
    return used;
  }
  used = indices;
  std::sort(used.begin(), used.end());
  used.erase(std::unique(used.begin(), used.end()), used.end());
  for (uint32_t& v : indices)
    v = static_cast<uint32_t>(std::lower_bound(used.begin(), used.end(), v) - used.begin());
  return used;
}

}  // namespace umbel::io
