// What is left of a budget once the finest view that fits is known goes to the groups that still
// fit, the one that is farthest from good enough first. A set of refined groups gives a cut without
// holes exactly if with each group all are in it that have clusters made from that group; so only
// such groups may follow.
#include <algorithm>
#include <queue>
#include <utility>

#include "base/hash.hpp"
#include "base/interner.hpp"
#include "base/parallel.hpp"
#include "lod/dag/generated_clusters.hpp"
#include "lod/select/budget.hpp"
#include "lod/select/cull.hpp"
#include "lod/select/instances.hpp"

namespace umbel::lod {
namespace {

/// A group that may be refined next.
struct Refinable {
  float turning_point, error;
  uint32_t instance, group;
  /// Whether another comes before this: the farther from good enough, the earlier. With the eye in
  /// their spheres many are infinitely far: then the larger error decides.
  bool operator<(const Refinable& other) const {
    if (turning_point != other.turning_point) return turning_point < other.turning_point;
    if (error != other.error) return error < other.error;
    if (instance != other.instance) return instance > other.instance;
    return group > other.group;
  }
};

/// The refined groups of one instance.
class InstanceCut {
 public:
  InstanceCut(const Tables& tables, const GeneratedClusters& generated, const Costs& costs,
              Seen wanted, Seen fitted, std::span<const ClusterBounds> normal_cones)
      : tables_(tables),
        generated_(generated),
        costs_(costs),
        wanted_(std::move(wanted)),
        fitted_(std::move(fitted)),
        normal_cones_(normal_cones) {}

  /// Whether the group may be refined next: its view wants it, and all above it are.
  bool is_next(uint32_t group) const {
    if (is_refined(group) || !must_refine(tables_.groups[group], wanted_.view)) return false;
    const auto above = generated_.of(group);
    return std::all_of(above.begin(), above.end(),
                       [&](uint32_t c) { return is_refined(tables_.clusters[c].group); });
  }

  std::vector<uint32_t> all_next() const {
    std::vector<uint32_t> groups;
    for (uint32_t g = 0; g < tables_.groups.size(); ++g)
      if (is_next(g)) groups.push_back(g);
    return groups;
  }

  Refinable candidate(uint32_t instance, uint32_t group) const {
    const Group& g = tables_.groups[group];
    return {turning_point(g, wanted_), g.error, instance, group};
  }

  /// What the cut costs more (or less) with the group refined.
  int64_t price(uint32_t group) const {
    int64_t price = cost_of_group(group, kNone);
    const auto [begin, end] = range(group);
    for (uint32_t c = begin; c < end; ++c)
      if (is_drawn(c)) price += cost_of_cluster(c);
    uint32_t last = kNone;
    for (const uint32_t c : generated_.of(group)) {
      if (!is_shown(c)) continue;
      price -= cost_of_cluster(c);
      // Clusters of a group are consecutive.
      const uint32_t above = tables_.clusters[c].group;
      if (above != last) price -= cost_of_group(above, kNone) - cost_of_group(above, group);
      last = above;
    }
    return price;
  }

  /// Groups that may have become next are appended.
  void refine(uint32_t group, std::vector<uint32_t>& next) {
    extra_.insert(group);
    uint32_t last = kNone;
    const auto [begin, end] = range(group);
    for (uint32_t c = begin; c < end; ++c) {
      const uint32_t below = tables_.clusters[c].generating_group;
      if (below != kNone && below != last && is_next(below)) next.push_back(below);
      last = below;
    }
    std::sort(next.begin(), next.end());
    next.erase(std::unique(next.begin(), next.end()), next.end());
  }

  /// Ascending.
  std::vector<uint32_t> clusters() const {
    // Clusters face the eye that is wanted: the view that fits may have none.
    const bool has_eye = fitted_.view.kind == wanted_.view.kind;
    std::vector<uint32_t> cut = select_hierarchy(
        tables_, fitted_.view,
        {fitted_.planes, has_eye ? normal_cones_ : std::span<const ClusterBounds>{}});
    if (has_eye && extra_.keys().empty()) return cut;
    std::erase_if(cut, [&](uint32_t c) { return !is_drawn(c); });
    for (const uint64_t group : extra_.keys()) {
      const auto [begin, end] = range(static_cast<uint32_t>(group));
      for (uint32_t c = begin; c < end; ++c)
        if (is_drawn(c)) cut.push_back(c);
    }
    std::sort(cut.begin(), cut.end());
    return cut;
  }

 private:
  /// Its first cluster and the one past its last.
  std::pair<uint32_t, uint32_t> range(uint32_t group) const {
    const Range& r = tables_.groups[group].clusters;
    return {r.offset, r.offset + r.count};
  }
  bool is_refined(uint32_t group) const {
    return must_refine(tables_.groups[group], fitted_.view) || extra_.contains(group);
  }
  /// Not left out, whatever the level of detail.
  bool is_shown(uint32_t cluster) const {
    const Group& group = tables_.groups[tables_.clusters[cluster].group];
    return !is_outside(group.sphere, fitted_.planes) &&
           is_visible(tables_, cluster, wanted_.view, {fitted_.planes, normal_cones_});
  }
  /// Of a cluster whose own group is refined, or about to be.
  bool is_drawn(uint32_t cluster) const {
    const uint32_t below = tables_.clusters[cluster].generating_group;
    return (below == kNone || !is_refined(below)) && is_shown(cluster);
  }
  int64_t cost_of_cluster(uint32_t cluster) const {
    return costs_.clusters.empty() ? 0 : costs_.clusters[cluster];
  }
  /// Of drawing any cluster of the group but those that `without` generated.
  int64_t cost_of_group(uint32_t group, uint32_t without) const {
    if (costs_.groups.empty()) return 0;
    const auto [begin, end] = range(group);
    for (uint32_t c = begin; c < end; ++c) {
      const uint32_t below = tables_.clusters[c].generating_group;
      if ((without == kNone || below != without) && is_drawn(c)) return costs_.groups[group];
    }
    return 0;
  }

  const Tables& tables_;
  const GeneratedClusters& generated_;
  const Costs& costs_;
  Seen wanted_, fitted_;
  std::span<const ClusterBounds> normal_cones_;
  Interner<uint64_t, IntegerHash> extra_;  ///< groups that are refined although no view says so
};

uint64_t cost_of(const Tables& tables, const Costs& costs, std::span<const uint32_t> cut) {
  uint64_t cost = 0;
  uint32_t last = kNone;
  for (const uint32_t c : cut) {
    if (!costs.clusters.empty()) cost += costs.clusters[c];
    const uint32_t group = tables.clusters[c].group;
    if (!costs.groups.empty() && group != last) cost += costs.groups[group];
    last = group;
  }
  return cost;
}

std::vector<InstanceCut> instance_cuts(const Tables& tables, const GeneratedClusters& generated,
                                       const Costs& costs, const View& wanted, const View& fitted,
                                       const Culling& culling,
                                       std::span<const Transform> instances) {
  std::vector<InstanceCut> cuts;
  if (instances.empty())
    cuts.emplace_back(tables, generated, costs, see(wanted, culling), see(fitted, culling),
                      culling.normal_cones);
  for (size_t i = 0; i < instances.size(); ++i) {
    const auto seen = [&](const View& view) {
      return of_instance(i, [&] { return see(view, culling, instances[i]); });
    };
    cuts.emplace_back(tables, generated, costs, seen(wanted), seen(fitted), culling.normal_cones);
  }
  return cuts;
}

/// Refines what fits, best first; `left` is what may be spent.
void refine_what_fits(std::vector<InstanceCut>& cuts, const Costs& costs, uint64_t left) {
  std::vector<std::vector<Refinable>> first(cuts.size());
  parallel_for(cuts.size(), 1, [&](size_t i) {
    for (const uint32_t g : cuts[i].all_next())
      first[i].push_back(cuts[i].candidate(static_cast<uint32_t>(i), g));
  });
  std::priority_queue<Refinable> queue;
  for (const std::vector<Refinable>& some : first)
    for (const Refinable& candidate : some) queue.push(candidate);
  int64_t room = static_cast<int64_t>(std::min<uint64_t>(left, INT64_MAX));
  std::vector<uint32_t> next;
  std::vector<Refinable> unaffordable;
  bool may_fit = false;  // whether some of them may be affordable by now
  while (!queue.empty()) {
    const Refinable best = queue.top();
    queue.pop();
    InstanceCut& cut = cuts[best.instance];
    const int64_t price = cut.price(best.group);
    if (price > room) {
      unaffordable.push_back(best);
    } else {
      room -= price;
      next.clear();
      cut.refine(best.group, next);
      for (const uint32_t g : next) queue.push(cut.candidate(best.instance, g));
      // There is more room, or a group is no longer drawn, so that others cost less.
      may_fit |= price < 0 || !costs.groups.empty();
    }
    if (!queue.empty() || !may_fit) continue;
    for (const Refinable& candidate : unaffordable) queue.push(candidate);
    unaffordable.clear();
    may_fit = false;
  }
}

}  // namespace

BudgetCuts select_for_budget(const Tables& tables, const View& view, const Costs& costs,
                             uint64_t budget, const Culling& culling,
                             std::span<const Transform> instances) {
  BudgetCuts result;
  const GeneratedClusters generated(tables);
  std::vector<InstanceCut> cuts;
  std::vector<std::vector<uint32_t>> clusters;
  const auto gather = [&] {
    clusters.resize(cuts.size());
    parallel_for(cuts.size(), 1, [&](size_t i) { clusters[i] = cuts[i].clusters(); });
    result.cost = 0;
    for (const auto& cut : clusters) result.cost += cost_of(tables, costs, cut);
  };
  result.view = view_for_budget(tables, view, costs, budget, culling, instances);
  cuts = instance_cuts(tables, generated, costs, view, result.view, culling, instances);
  gather();
  if (result.cost <= budget) {
    refine_what_fits(cuts, costs, budget - result.cost);
    gather();
  }
  result.cuts = join_cuts(clusters);
  return result;
}

}  // namespace umbel::lod
