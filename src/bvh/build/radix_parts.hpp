// Radix trees over sorted Morton codes, divided into parts that fit into the cache and are built in
// parallel. The division depends on nothing but the codes.
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "bvh/build/morton_stack.hpp"
#include "bvh/build/part_writer.hpp"

namespace umbel::bvh {

/// A tree whose leaves are radix trees. Inner nodes come before what is below them; a child is
/// another one, or ~part.
template <typename Key>
class RadixParts {
 public:
  explicit RadixParts(const Key* codes) : codes_(codes) {}

  /// An inner node; its children are set later.
  uint32_t add_inner() {
    top_.push_back({});
    return static_cast<uint32_t>(top_.size() - 1);
  }
  void set_children(uint32_t inner, uint32_t left, uint32_t right) { top_[inner] = {left, right}; }

  /// The radix tree over a range of codes that ascend. Returns the child that it is.
  uint32_t add(Range codes) {
    struct Task {
      Range range;
      uint32_t parent;
      bool left;
    };
    uint32_t root = kNone;
    std::vector<Task> tasks = {{codes, kNone, false}};
    while (!tasks.empty()) {
      const Task task = tasks.back();
      tasks.pop_back();
      const auto [offset, count] = task.range;
      uint32_t id;
      if (count <= kMostCodes) {
        id = ~static_cast<uint32_t>(ranges_.size());
        ranges_.push_back(task.range);
      } else {
        id = add_inner();
        const uint32_t split = radix_split(codes_, offset, offset + count);
        tasks.push_back({{split, offset + count - split}, id, false});
        tasks.push_back({{offset, split - offset}, id, true});
      }
      if (task.parent == kNone)
        root = id;
      else
        (task.left ? top_[task.parent].left : top_[task.parent].right) = id;
    }
    return root;
  }

  /// `primitives` are in the order of the codes.
  Bvh2 build(Boxes boxes, std::vector<uint32_t> primitives, const LeafRule& rule) const {
    const MortonStack<Key> stack(codes_, primitives.data(), boxes, rule);
    const MostNodes most{2 * size_t(kMostCodes), 2 * primitives.size()};
    return write_parts(top_, most, std::move(primitives), [&](uint32_t part, Node* nodes_end) {
      const auto [offset, count] = ranges_[part];
      return stack.build(offset, offset + count, nodes_end);
    });
  }

 private:
  static constexpr uint32_t kMostCodes = 1u << 14;  // of a part: its nodes stay in the cache

  const Key* codes_;
  std::vector<Range> ranges_;
  std::vector<TopNode> top_;
};

}  // namespace umbel::bvh
