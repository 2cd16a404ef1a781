// A view, the groups that it has reached, and when each of them must be evaluated again.
#pragma once

#include <array>
#include <memory>
#include <vector>

#include "stream/due_queue.hpp"
#include "stream/view_motion.hpp"
#include "umbel/stream.hpp"

namespace umbel::stream {

/// A number for some of a mesh's groups. Neighbouring groups are reached together, so numbers are
/// stored in blocks.
class GroupMap {
 public:
  explicit GroupMap(uint32_t groups) : blocks_((groups + kBlock - 1) / kBlock) {}
  uint32_t find(uint32_t group) const {
    const auto& block = blocks_[group / kBlock];
    return block ? (*block)[group % kBlock] : kNone;
  }
  uint32_t& at(uint32_t group) {
    auto& block = blocks_[group / kBlock];
    if (!block) {
      block = std::make_unique<std::array<uint32_t, kBlock>>();
      block->fill(kNone);
    }
    return (*block)[group % kBlock];
  }
  template <typename Visit>
  void for_each(const Visit& visit) const {
    for (const auto& block : blocks_)
      if (block)
        for (const uint32_t value : *block)
          if (value != kNone) visit(value);
  }

 private:
  static constexpr uint32_t kBlock = 256;
  std::vector<std::unique_ptr<std::array<uint32_t, kBlock>>> blocks_;
};

class TrackedView {
 public:
  TrackedView(StreamView of, uint32_t groups) : view(std::move(of)), nodes(groups) {}

  /// Goes on to the next view of the same mesh, and appends the entries that become due. False if
  /// nothing of what was scheduled holds any more: all nodes must be evaluated again.
  bool move_to(const StreamView& next, std::vector<DueQueue::Entry>& due);
  /// Schedules a node until its evaluation's margins are used up, rounded down.
  void schedule(uint32_t node, uint32_t stamp, const Evaluation& evaluation);

  StreamView view;
  GroupMap nodes;  ///< by group

 private:
  /// Nodes that one reason may change, whose groups have about the same reach.
  struct Queue {
    Reason reason;
    int size;
    double reach;
    DueQueue due;
    /// Scheduled in this step, and so due after the next motion at the earliest.
    std::vector<DueQueue::Entry> fresh;
    /// A distance in ticks of a small part of the reach.
    double ticks(double distance) const;
  };

  void schedule(uint32_t node, uint32_t stamp, Reason reason, int size, double margin);

  ViewMotion motion_;
  std::vector<Queue> queues_;
};

}  // namespace umbel::stream
