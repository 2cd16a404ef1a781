// A monotone priority queue: a radix heap (Ahuja, Mehlhorn, Orlin and Tarjan, "Faster Algorithms
// for the Shortest Path Problem", 1990). Keys are never below those taken so far, so entries move
// to shorter lists as they become due, and nothing is sorted.
#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

namespace umbel::stream {

class DueQueue {
 public:
  struct Entry {
    uint64_t key;
    uint32_t node, stamp;
  };

  /// A key that is not below that of any entry taken so far.
  void push(const Entry& entry) {
    const auto list = static_cast<size_t>(std::bit_width(entry.key ^ last_));
    if (list >= lists_.size()) lists_.resize(list + 1);
    lists_[list].entries.push_back(entry);
    lists_[list].least = std::min(lists_[list].least, entry.key);
  }

  /// Appends all entries whose keys are below `now` to `out`, and forgets them.
  void take(uint64_t now, std::vector<Entry>& out) {
    while (true) {
      const auto list = std::find_if(lists_.begin(), lists_.end(),
                                     [](const List& l) { return !l.entries.empty(); });
      if (list == lists_.end() || list->least >= now) return;
      const std::vector<Entry> entries = std::exchange(list->entries, {});
      last_ = std::exchange(list->least, kNever);
      for (const Entry& entry : entries) {
        if (entry.key < now)
          out.push_back(entry);
        else
          push(entry);
      }
    }
  }

 private:
  static constexpr uint64_t kNever = std::numeric_limits<uint64_t>::max();
  /// Those whose keys differ from `last_` in this bit and none above, or, in the first list, not.
  struct List {
    uint64_t least = kNever;
    std::vector<Entry> entries;
  };

  uint64_t last_ = 0;
  std::vector<List> lists_;
};

}  // namespace umbel::stream
