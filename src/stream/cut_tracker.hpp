// The cuts of all views over the pages that are in memory, updated from step to step.
//
// A traversal from the roots costs what is shown, thousands of times what changes. So each group
// that a view has reached is kept as a node, with how far the view may move before the group's
// error can become, or cease to be, too large (view_motion.hpp). A step evaluates nodes that may
// have changed and new ones, and no others. A group that need not be open closes once all that was
// opened below it has closed, so the cut is whole at any time, and a step can stop anywhere and the
// next go on.
#pragma once

#include <deque>
#include <span>
#include <vector>

#include "stream/page_tables.hpp"
#include "stream/tracked_node.hpp"
#include "stream/tracked_view.hpp"
#include "stream/wanted_pages.hpp"
#include "umbel/stream.hpp"

namespace umbel::stream {

class CutTracker {
 public:
  explicit CutTracker(const Asset& asset);

  void install(const AssetPage& page);
  /// Closes what shows it first.
  void remove(uint32_t page);
  /// Goes on to these views, evaluating about `most` groups at the most. True if all that may have
  /// changed has been evaluated.
  bool follow(std::span<const StreamView> views, uint64_t most);

  /// Groups evaluated, ever.
  uint64_t work() const { return work_; }
  uint32_t open_groups() const { return open_groups_; }
  std::span<const StreamCluster> cut() const { return cut_.clusters(); }
  /// Groups that are wanted and whose pages are not in memory.
  std::span<const MissingList::Missing> missing() const { return missing_.all(); }
  uint32_t page_of(const MissingList::Missing& missing) const {
    return nodes_[missing.node].reference.page;
  }

  const WantedPages& pages() const { return pages_; }
  /// Pages that have become wanted, or ceased to be, since the last call.
  std::vector<uint32_t> take_changed() { return pages_.take_changed(); }
  /// Calls visit(page) for each other page through which a wanted group of `page` was reached.
  template <typename Visit>
  void for_each_page_above(uint32_t page, const Visit& visit) const {
    for (uint32_t n = pages_.first_node(page); n != kNone; n = nodes_[n].after)
      for (uint32_t e = nodes_[n].first_edge; e != kNone; e = edges_[e].next)
        if (const uint32_t from = nodes_[edges_[e].parent].reference.page; from != page)
          visit(from);
  }

 private:
  struct Edge {
    uint32_t parent, next;
  };
  struct Pending {
    uint32_t node, stamp;
  };

  void begin_view(uint32_t index, const StreamView& view);
  void end_view(uint32_t index);
  bool evaluate_pending();
  bool evaluate_due();
  void update(uint32_t node);
  void update_later(uint32_t node) { pending_.push_back({node, nodes_[node].stamp}); }

  uint32_t track(uint32_t view, const GroupRef& reference);
  void untrack(uint32_t node);
  void link(uint32_t parent, uint32_t child);
  void unlink(uint32_t parent, uint32_t child);
  void want(uint32_t node, float ratio);
  void open(uint32_t node);
  void close(uint32_t node);
  void finish_closing(uint32_t node);

  const Asset& asset_;
  PageTables tables_;
  WantedPages pages_;
  std::vector<TrackedNode> nodes_;
  std::vector<Edge> edges_;
  std::vector<uint32_t> free_nodes_, free_edges_;
  std::vector<TrackedView> views_;
  std::deque<Pending> pending_;
  std::vector<DueQueue::Entry> due_;
  size_t next_due_ = 0;
  MissingList missing_;
  CutList cut_;
  uint32_t open_groups_ = 0;
  uint64_t work_ = 0;
};

}  // namespace umbel::stream
