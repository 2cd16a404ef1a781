// A group as one view has reached it, and the lists that nodes are in: the clusters of the cut, and
// the groups whose pages are missing. Nodes know their index in a list, and lists their nodes, so
// both change in constant time.
#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "umbel/stream.hpp"

namespace umbel::stream {

/// What an evaluation needs comes first, in one cache line.
struct alignas(64) TrackedNode {
  GroupRef reference;
  uint32_t view;
  uint32_t stamp = 0;  ///< counts evaluations
  float ratio = 0;     ///< how many times too large its error is; 0: it is not
  uint32_t open_parents = 0, open_children = 0;
  uint32_t missing_at = kNone;  ///< index in MissingList
  bool is_open = false;

  uint32_t in_page = 0;                    ///< while open: the index of its group in its page
  uint32_t first_edge = kNone;             ///< to its open parents
  uint32_t before = kNone, after = kNone;  ///< among the wanted nodes of its page
  std::vector<uint32_t> shown;  ///< while open: the index of each cluster in the cut, or kNone
};

class CutList {
 public:
  std::span<const StreamCluster> clusters() const { return clusters_; }

  void show(std::vector<TrackedNode>& nodes, uint32_t n, uint32_t cluster) {
    TrackedNode& node = nodes[n];
    if (node.shown[cluster] != kNone) return;
    node.shown[cluster] = static_cast<uint32_t>(clusters_.size());
    clusters_.push_back({node.view, node.reference.page, node.in_page, cluster});
    owners_.push_back({n, cluster});
  }

  void hide(std::vector<TrackedNode>& nodes, uint32_t n, uint32_t cluster) {
    const uint32_t at = std::exchange(nodes[n].shown[cluster], kNone);
    if (at == kNone) return;
    const Owner last = owners_.back();
    if (at + 1 < clusters_.size()) {
      clusters_[at] = clusters_.back();
      owners_[at] = last;
      nodes[last.node].shown[last.cluster] = at;
    }
    clusters_.pop_back();
    owners_.pop_back();
  }

 private:
  struct Owner {
    uint32_t node, cluster;
  };
  std::vector<StreamCluster> clusters_;
  std::vector<Owner> owners_;  // of the clusters
};

class MissingList {
 public:
  struct Missing {
    float ratio;
    uint32_t node;
  };

  std::span<const Missing> all() const { return missing_; }

  void add(std::vector<TrackedNode>& nodes, uint32_t n) {
    nodes[n].missing_at = static_cast<uint32_t>(missing_.size());
    missing_.push_back({nodes[n].ratio, n});
  }

  void update(const TrackedNode& node) { missing_[node.missing_at].ratio = node.ratio; }

  void remove(std::vector<TrackedNode>& nodes, uint32_t n) {
    const uint32_t at = std::exchange(nodes[n].missing_at, kNone);
    missing_[at] = missing_.back();
    nodes[missing_[at].node].missing_at = at;
    if (missing_[at].node == n) nodes[n].missing_at = kNone;
    missing_.pop_back();
  }

 private:
  std::vector<Missing> missing_;
};

}  // namespace umbel::stream
