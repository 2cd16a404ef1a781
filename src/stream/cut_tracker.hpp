// What views show of the pages that are there, kept from step to step.
//
// A walk from the roots through all open groups costs what is shown, thousands of times what
// changes. So each group that a view has met is kept, with how far the view may move before the
// group's error can begin or cease to be too large (motion.hpp); a step looks at those that may
// have changed, at new ones, and at nothing else. The clusters that are shown are kept likewise. A
// group that need not be open closes once all that was opened below it has closed, so what is shown
// is whole at any time, and work can stop at any time and go on in the next step.
#pragma once

#include <array>
#include <deque>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "stream/due_queue.hpp"
#include "stream/motion.hpp"
#include "umbel/stream.hpp"

namespace umbel::stream {

/// What is read of a page's groups, close together: the pages of a large cut are far more than
/// caches hold.
struct WalkTable {
  struct Entry {
    uint32_t mesh, group, first_child, first_cluster;
  };
  std::vector<Entry> groups;  // and one behind the last
  std::vector<GroupRef> children;
  std::vector<uint32_t> made_from;  // of each cluster, or kNone
};

/// Numbers by group, for those that have one: in blocks, as neighbours are met together.
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

class Frontier {
 public:
  struct Missing {
    float ratio;
    uint32_t node;
  };

  explicit Frontier(const Asset& asset);

  void install(const AssetPage& page);
  /// Whatever shows it is closed first.
  void remove(uint32_t page);
  /// Goes on to these views, looking at about `most` groups at the most. True if all that may have
  /// changed has been looked at.
  bool follow(std::span<const StreamView> views, uint64_t most);

  /// Groups that it has looked at, ever.
  uint64_t work() const { return work_; }
  uint32_t open_groups() const { return open_groups_; }
  std::span<const StreamCluster> cut() const { return cut_; }
  /// Groups that are wanted and whose pages are not there.
  std::span<const Missing> missing() const { return missing_; }
  uint32_t page_of(const Missing& missing) const { return nodes_[missing.node].reference.page; }

  /// Whether some view shows, or would show, what a group in the page was refined to.
  bool is_wanted(uint32_t page) const { return pages_[page].wanted > 0; }
  /// The sum, over the page's wanted groups, of the squares of how many times too large their
  /// errors are.
  double worth(uint32_t page) const { return pages_[page].worth; }
  /// Whether nothing in another page is shown by way of this one.
  bool is_end(uint32_t page) const { return pages_[page].open_elsewhere == 0; }
  /// Pages that have begun or ceased to be wanted since this was last asked.
  std::vector<uint32_t> take_changed() { return std::exchange(changed_, {}); }
  /// Calls visit(page) for each other page by way of which something wanted in `page` is reached.
  template <typename Visit>
  void for_each_way_to(uint32_t page, const Visit& visit) const {
    for (uint32_t n = pages_[page].first; n != kNone; n = nodes_[n].after)
      for (uint32_t e = nodes_[n].first_edge; e != kNone; e = edges_[e].next)
        if (const uint32_t from = nodes_[edges_[e].parent].reference.page; from != page)
          visit(from);
  }

 private:
  /// A group as one view has met it, through groups that are open. What looking at it needs comes
  /// first, in one line of the cache.
  struct alignas(64) Node {
    GroupRef reference;
    uint32_t view;
    uint32_t stamp = 0;  ///< counts how often it was looked at
    float ratio = 0;     ///< how many times too large its error is; 0: it is not
    uint32_t open_parents = 0, open_children = 0;
    uint32_t missing_at = kNone;
    bool is_open = false;

    uint32_t in_page = 0;                    ///< while open: where its group is in its page
    uint32_t first_edge = kNone;             ///< to its open parents
    uint32_t before = kNone, after = kNone;  ///< among the wanted nodes of its page
    std::vector<uint32_t> shown;  ///< while open: where its clusters are in the cut, or kNone
  };
  struct Edge {
    uint32_t parent, next;
  };
  struct Page {
    WalkTable table;
    bool is_there = false;
    uint32_t first = kNone, wanted = 0;  ///< nodes whose errors are too large
    uint32_t open_elsewhere = 0;         ///< open nodes in other pages, once for each parent here
    double worth = 0;
  };
  /// What may change for one reason, of groups of about one reach.
  struct Queue {
    Reason reason;
    int size;
    double reach;
    DueQueue due;
    std::vector<DueQueue::Entry>
        fresh;  ///< of this step: due after the next motion at the earliest
    /// The clock in ticks of a small part of the reach.
    double ticks(double clock) const { return std::floor(clock / reach * 0x1p14); }
  };
  struct Watch {
    StreamView view;
    Motion motion;
    GroupMap nodes;
    std::vector<Queue> queues;
  };
  struct Todo {
    uint32_t node, stamp;
  };
  struct Owner {
    uint32_t node, cluster;
  };

  void begin(uint32_t index, const StreamView& view);
  void end(uint32_t index);
  void move(uint32_t index, const StreamView& view);
  bool look_at_new();
  void look_at_all_again(Watch& watch);
  bool look_at_due();
  void keep(uint32_t node, Watch& watch, Reason reason, int size, double margin);
  void look(uint32_t node);
  void look_later(uint32_t node) { todo_.push_back({node, nodes_[node].stamp}); }

  uint32_t meet(uint32_t view, const GroupRef& reference);
  void drop(uint32_t node);
  void link(uint32_t parent, uint32_t child);
  void unlink(uint32_t parent, uint32_t child);
  void want(uint32_t node, float ratio);
  void open(uint32_t node);
  void close(uint32_t node);
  void finish_closing(uint32_t node);
  void show(uint32_t node, uint32_t cluster);
  void hide(uint32_t node, uint32_t cluster);
  void add_missing(uint32_t node);
  void remove_missing(uint32_t node);

  bool find_in_page(Node& node) const;
  std::span<const GroupRef> children_of(uint32_t node) const;
  std::span<const uint32_t> made_from(uint32_t node) const;

  const Asset& asset_;
  std::vector<std::vector<uint32_t>> in_page_;  // by mesh and group
  std::vector<Page> pages_;
  std::vector<Node> nodes_;
  std::vector<Edge> edges_;
  std::vector<uint32_t> free_nodes_, free_edges_;
  std::vector<Watch> watches_;
  std::deque<Todo> todo_;
  std::vector<DueQueue::Entry> due_;
  size_t next_due_ = 0;
  std::vector<Missing> missing_;
  std::vector<uint32_t> changed_;
  std::vector<StreamCluster> cut_;
  std::vector<Owner> owners_;  // of the elements of the cut
  uint32_t open_groups_ = 0;
  uint64_t work_ = 0;
};

}  // namespace umbel::stream
