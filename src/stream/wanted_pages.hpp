// Of every page: which tracked nodes in it want finer groups, how much, and whether others depend
// on it.
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "stream/tracked_node.hpp"
#include "umbel/stream.hpp"

namespace umbel::stream {

class WantedPages {
 public:
  explicit WantedPages(uint32_t count) : pages_(count) {}

  /// Whether a group of the page must be refined in some view.
  bool is_wanted(uint32_t page) const { return pages_[page].wanted > 0; }
  /// The sum, over the page's wanted groups, of the squares of how many times too large their
  /// errors are.
  double priority(uint32_t page) const { return pages_[page].priority; }
  /// Whether no open group in another page was reached through this one.
  bool is_leaf(uint32_t page) const { return pages_[page].open_in_others == 0; }
  /// The first of the page's wanted nodes, which TrackedNode::after links; or kNone.
  uint32_t first_node(uint32_t page) const { return pages_[page].first; }

  /// Pages that have become wanted, or ceased to be, since the last call.
  std::vector<uint32_t> take_changed() { return std::exchange(changed_, {}); }

  /// Sets a node's ratio, and what follows from it for its page.
  void set_ratio(std::vector<TrackedNode>& nodes, uint32_t n, float ratio) {
    TrackedNode& node = nodes[n];
    Page& page = pages_[node.reference.page];
    const float before = std::exchange(node.ratio, ratio);
    page.priority += double{ratio} * ratio - double{before} * before;
    if (before == 0 && ratio > 0) {
      node.before = kNone;
      node.after = page.first;
      if (page.first != kNone) nodes[page.first].before = n;
      page.first = n;
      if (page.wanted++ == 0) changed_.push_back(node.reference.page);
    } else if (before > 0 && ratio == 0) {
      (node.before == kNone ? page.first : nodes[node.before].after) = node.after;
      if (node.after != kNone) nodes[node.after].before = node.before;
      if (--page.wanted == 0) changed_.push_back(node.reference.page), page.priority = 0;
    }
  }

  /// A node of `child` has opened that was reached through one of `parent`, or has closed.
  void count_opened(uint32_t parent, uint32_t child) {
    pages_[parent].open_in_others += parent != child;
  }
  void count_closed(uint32_t parent, uint32_t child) {
    pages_[parent].open_in_others -= parent != child;
  }

 private:
  struct Page {
    uint32_t first = kNone, wanted = 0;  ///< nodes whose errors are too large
    uint32_t open_in_others = 0;         ///< open nodes in other pages, once for each parent here
    double priority = 0;
  };

  std::vector<Page> pages_;
  std::vector<uint32_t> changed_;
};

}  // namespace umbel::stream
