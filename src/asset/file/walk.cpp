// Finds cuts by descending from the roots by references. A reference says all that the test of its
// group needs, so only pages of groups that must be refined are read, and not even those where the
// table of coarse groups says that all of them is refined further. Pages never come before those
// that refer to them, so taking the lowest page first reads each once, in the order of the file.
#include <algorithm>
#include <optional>
#include <queue>
#include <unordered_set>

#include "asset/file/follow_reference.hpp"
#include "lod/dag/join_clusters.hpp"
#include "lod/select/cull.hpp"
#include "umbel/asset.hpp"

namespace umbel {
namespace {

/// The level of a group, by the file's ranges: all that a reference does not say.
class Levels {
 public:
  explicit Levels(std::span<const Range> levels) : levels_(levels) {}
  uint32_t of(uint32_t group) const {
    // Levels are consecutive ranges of groups.
    const auto after = std::partition_point(levels_.begin(), levels_.end(), [&](const Range& r) {
      return uint64_t{r.offset} + r.count <= group;
    });
    return static_cast<uint32_t>(after - levels_.begin());
  }

 private:
  std::span<const Range> levels_;
};

class Walk {
 public:
  Walk(const Asset& asset, const lod::View& view, const CutVisitor& visit, uint32_t mesh,
       std::span<const Plane> planes)
      : asset_(asset),
        view_(view),
        visit_(visit),
        planes_(planes),
        mesh_(mesh),
        levels_(asset.levels(mesh)) {}

  WalkReport run() {
    for (const GroupRef& root : asset_.roots(mesh_)) reach(root);
    while (!pending_.empty()) visit_page(pending_.top().page);
    return report_;
  }

 private:
  struct Later {
    bool operator()(const GroupRef& a, const GroupRef& b) const {
      return a.page != b.page ? a.page > b.page : a.group > b.group;
    }
  };

  /// Whether the group must be refined; if so it is pending, unless all of it is outside.
  bool reach(const GroupRef& group) {
    const uint32_t level = view_.kind == lod::View::Kind::kLevel ? levels_.of(group.group) : 0;
    if (!lod::must_refine(group.sphere, group.error, level, view_)) return false;
    if (!is_all_outside(group.sphere) && reached_.insert(group.group).second) pending_.push(group);
    return true;
  }

  /// Whether the group is outside, and so by the rounding of these tests is all that it was made
  /// from. Spheres of groups have no margin, as those of the hierarchy's nodes do.
  bool is_all_outside(const Sphere& sphere) const {
    constexpr float kMargin = 1 + 0x1p-12f;
    return lod::is_node_outside({sphere.center, sphere.radius * kMargin}, planes_);
  }

  void visit_page(uint32_t index) {
    std::optional<AssetPage> page;
    bool in_cut = false;
    while (!pending_.empty() && pending_.top().page == index) {
      const GroupRef reference = pending_.top();
      pending_.pop();
      if (is_passed(reference.group)) continue;
      if (!page) {
        page = asset_.read_page(index);
        ++report_.pages;
      }
      in_cut |= visit_group(*page, asset::follow(reference, *page, mesh_));
    }
    report_.cut_pages += in_cut;
  }

  /// Whether it is known without its page that no cluster of the group is in the cut.
  bool is_passed(uint32_t group) {
    const Refinement* known = asset_.refinement(group, mesh_);
    if (!known || known->triangles > 0) return false;
    bool all_refined = true;
    for (const Refinement::Part& part : known->parts) all_refined &= reach(part.group);
    return all_refined;
  }

  /// Whether the group has clusters in the cut.
  bool visit_group(const AssetPage& page, uint32_t index) {
    const PageGroup& group = page.groups[index];
    refined_.clear();
    for (const GroupRef& child : group.children)
      if (reach(child)) refined_.push_back(child.group);
    if (lod::is_outside(group.group.sphere, planes_)) return false;
    chosen_.clear();
    for (uint32_t c = 0; c < group.clusters.size(); ++c)
      if (is_in_cut(group.clusters[c])) choose(group, c);
    if (chosen_.empty()) return false;
    ++report_.groups;
    report_.clusters += chosen_.size();
    visit_({page, index, chosen_});
    return true;
  }

  bool is_in_cut(const lod::Cluster& cluster) const {
    if (cluster.generating_group != kNone &&
        std::find(refined_.begin(), refined_.end(), cluster.generating_group) != refined_.end())
      return false;
    return !lod::is_outside(cluster.box, planes_);
  }

  void choose(const PageGroup& group, uint32_t c) {
    const lod::Cluster& cluster = group.clusters[c];
    chosen_.push_back(c);
    report_.triangles += cluster.triangle_count;
    for (const GroupRef& child : group.children)
      if (child.group == cluster.generating_group)
        report_.error = std::max(report_.error, child.error);
  }

  const Asset& asset_;
  const lod::View& view_;
  const CutVisitor& visit_;
  std::span<const Plane> planes_;
  uint32_t mesh_;
  Levels levels_;
  std::priority_queue<GroupRef, std::vector<GroupRef>, Later> pending_;
  std::unordered_set<uint32_t> reached_;  ///< groups that are or were pending
  std::vector<uint32_t> refined_, chosen_;
  WalkReport report_;
};

/// The pages that were read last, as far as there is room: clusters by number go through pages from
/// fine levels to coarse, and of one level nearly in order.
class RecentPages {
 public:
  explicit RecentPages(const Asset& asset) : asset_(asset) {}

  const std::vector<lod::ClusterGeometry>& group(const CutCluster& cluster) {
    const uint64_t key = uint64_t{cluster.page} << 32 | cluster.group;
    const auto known = std::find_if(groups_.begin(), groups_.end(),
                                    [&](const Decoded& d) { return d.key == key; });
    if (known != groups_.end()) return known->clusters;
    const AssetPage& page = this->page(cluster.page);
    Decoded& slot = groups_[next_group_++ % groups_.size()];
    slot = {};
    slot.clusters = asset_.decode(page, cluster.group);
    slot.key = key;
    return slot.clusters;
  }

 private:
  struct Decoded {
    uint64_t key = ~uint64_t{0};
    std::vector<lod::ClusterGeometry> clusters;
  };

  const AssetPage& page(uint32_t index) {
    for (const AssetPage& page : pages_)
      if (!page.bytes.empty() && page.index == index) return page;
    AssetPage& slot = pages_[next_page_++ % pages_.size()];
    slot = {};
    slot = asset_.read_page(index);
    return slot;
  }

  const Asset& asset_;
  std::array<AssetPage, 32> pages_;
  std::array<Decoded, 4> groups_;
  size_t next_page_ = 0, next_group_ = 0;
};

}  // namespace

WalkReport Asset::walk(const lod::View& view, const CutVisitor& visit, uint32_t mesh,
                       std::span<const Plane> planes) const {
  lod::check({}, view, {planes, {}});
  return Walk(*this, view, visit, mesh, planes).run();
}

std::vector<CutCluster> clusters_of_cut(const Asset& asset, const lod::View& view, uint32_t mesh,
                                        std::span<const Plane> planes, WalkReport* report) {
  std::vector<CutCluster> cut;
  const auto add = [&](const CutGroup& found) {
    const PageGroup& group = found.page.groups[found.index];
    for (const uint32_t c : found.clusters) {
      const lod::Cluster& cluster = group.clusters[c];
      cut.push_back({group.group.clusters.offset + c, found.page.index, found.index, c,
                     cluster.material, cluster.triangle_count});
    }
  };
  const WalkReport made = asset.walk(view, add, mesh, planes);
  if (report) *report = made;
  std::sort(cut.begin(), cut.end());
  return cut;
}

Mesh mesh_of_clusters(const Asset& asset, std::span<const CutCluster> cut) {
  std::vector<lod::JoinedCluster> clusters;
  clusters.reserve(cut.size());
  for (const CutCluster& c : cut) clusters.push_back({c.id, c.material, c.triangles});
  RecentPages recent(asset);
  return lod::join_clusters(clusters, [&](uint32_t k) {
    const auto& group = recent.group(cut[k]);
    if (cut[k].cluster >= group.size())
      throw Error(ErrorCode::kInvalidArgument, "a cluster of the cut is not in the asset");
    return group[cut[k].cluster];
  });
}

}  // namespace umbel
