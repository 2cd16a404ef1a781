// Which boxes touch a box, by a kd-tree over them.
#include <algorithm>

#include "query/overlap.hpp"
#include "umbel/kdtree_traverse.hpp"

namespace umbel::kdtree {

std::vector<uint32_t> overlaps(const Tree& tree, std::span<const Aabb> boxes, const Aabb& box) {
  std::vector<uint32_t> found;
  if (is_empty(box)) return found;  // the tests below are for boxes with min <= max
  traverse(tree, box, [&](std::span<const uint32_t> primitives) {
    for (const uint32_t i : primitives) {
      if (i >= boxes.size())
        throw Error(ErrorCode::kInvalidArgument, "the tree is not one over these boxes");
      if (overlap::meet(boxes[i], box)) found.push_back(i);
    }
    return true;
  });
  std::sort(found.begin(), found.end());
  found.erase(std::unique(found.begin(), found.end()), found.end());
  return found;
}

}  // namespace umbel::kdtree
