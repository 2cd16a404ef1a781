// The finest view whose cuts have no more triangles than a budget: from the coarsest cut on, the
// group whose error is the largest for the view is refined next, until the next would be too much.
// Errors never grow towards the source, so this goes through all cuts from coarse to fine.
#include <algorithm>
#include <deque>
#include <map>
#include <queue>
#include <unordered_map>

#include "asset/file/coarse_groups.hpp"
#include "asset/file/follow_reference.hpp"
#include "base/math.hpp"
#include "lod/select/turning_point.hpp"
#include "umbel/asset.hpp"

namespace umbel {
namespace {

/// What refining groups changes. A page that was read stays, without its bytes.
class Costs {
 public:
  explicit Costs(const Asset& asset) : asset_(asset) {}

  const Refinement& of(uint32_t mesh, const GroupRef& reference) {
    if (const Refinement* known = asset_.refinement(reference.group, mesh)) return *known;
    const auto [at, is_new] = pages_.try_emplace(reference.page);
    if (is_new) read(reference.page, at->second);
    for (const Entry& entry : at->second)
      if (entry.mesh == mesh && entry.group == reference.group) {
        if (!asset::agrees(reference, {{}, 0, {}, entry.sphere, entry.error}))
          asset::disagree(reference);
        return entry.cost;
      }
    corrupt("group " + std::to_string(reference.group) + " is not in page " +
            std::to_string(reference.page) + ", where a reference says it is");
  }

 private:
  struct Entry {
    uint32_t mesh, group;
    Sphere sphere;
    float error;
    Refinement cost;
  };

  void read(uint32_t index, std::vector<Entry>& entries) const {
    const AssetPage page = asset_.read_page(index);
    for (const PageGroup& group : page.groups)
      entries.push_back({group.mesh, group.id, group.group.sphere, group.group.error,
                         asset::refinement_of(group.clusters, group.children)});
  }

  const Asset& asset_;
  std::unordered_map<uint32_t, std::vector<Entry>> pages_;
};

/// A mesh as one or more instances show it, all of them with the same cut.
struct Shown {
  struct State {
    uint64_t triangles = 0;  ///< of the cut's clusters that were made from the group
    bool is_refined = false;
  };
  uint32_t mesh;
  lod::View view;  ///< in the mesh's own space
  double factor;   ///< from the scene's errors or thresholds to the mesh's
  uint64_t instances = 1;
  std::unordered_map<uint32_t, State> groups;
};

class Budget {
 public:
  Budget(const Asset& asset, const lod::View& view, std::span<const Instance> instances)
      : costs_(asset), view_(view) {
    if (instances.empty())
      for (uint32_t m = 0; m < asset.meshes().size(); ++m) shown_.push_back({m, view, 1.0, 1, {}});
    else
      add(instances);
    for (Shown& shown : shown_)
      for (const GroupRef& root : asset.roots(shown.mesh)) reach(shown, root);
  }

  /// The least error or threshold from `least` on whose cuts have at most so many triangles.
  float find(float least, uint64_t most) {
    refine(kInfinity);
    float fits = kInfinity;
    for (bool is_first = true;; is_first = false) {
      const bool is_last = queue_.empty() || queue_.top().key <= least;
      const float value = is_last ? least : queue_.top().key;
      if (triangles_ > most && is_first)
        return view_.kind == lod::View::Kind::kError ? value : kInfinity;
      if (triangles_ > most) return fits;
      if (is_last) return least;
      fits = value;
      refine(value);
    }
  }

 private:
  struct Pending {
    float key;
    Shown* shown;
    GroupRef group;
    bool operator<(const Pending& other) const { return key < other.key; }
  };

  /// A transform that flattens things has errors, but no camera in its space.
  static double factor_of(const Transform& transform, bool by_error) {
    if (by_error) return 1 / lod::largest_stretch(transform);
    const lod::Stretch s = lod::stretch(transform);
    return s.least / s.most;
  }

  /// Instances that differ only in what does not change their cuts count together.
  void add(std::span<const Instance> instances) {
    std::map<std::pair<uint32_t, double>, Shown*> alike;
    for (size_t i = 0; i < instances.size(); ++i) {
      const Instance& instance = instances[i];
      const bool by_error = view_.kind == lod::View::Kind::kError;
      const double factor =
          lod::of_instance(i, [&] { return factor_of(instance.transform, by_error); });
      Shown* known = nullptr;
      if (by_error) known = alike[{instance.mesh, factor}];
      if (known) {
        ++known->instances;
        continue;
      }
      const lod::View own_view =
          lod::of_instance(i, [&] { return lod::to_object(view_, instance.transform); });
      shown_.push_back({instance.mesh, own_view, factor, 1, {}});
      if (by_error) alike[{instance.mesh, factor}] = &shown_.back();
    }
  }

  void reach(Shown& shown, const GroupRef& group) {
    const float key = lod::turning_point(group.sphere, group.error, shown.view, shown.factor);
    queue_.push({key, &shown, group});
  }

  /// Refines all groups whose key is not below the given one.
  void refine(float key) {
    while (!queue_.empty() && queue_.top().key >= key) {
      const Pending next = queue_.top();
      queue_.pop();
      refine(*next.shown, next.group);
    }
  }

  void refine(Shown& shown, const GroupRef& reference) {
    Shown::State& state = shown.groups[reference.group];
    if (state.is_refined) return;
    state.is_refined = true;
    triangles_ -= shown.instances * state.triangles;
    const Refinement& cost = costs_.of(shown.mesh, reference);
    triangles_ += shown.instances * cost.triangles;
    for (const Refinement::Part& part : cost.parts) {
      const auto [at, is_new] = shown.groups.try_emplace(part.group.group);
      // One that was refined before has a parent with the same error.
      if (at->second.is_refined) continue;
      at->second.triangles += part.triangles;
      triangles_ += shown.instances * part.triangles;
      if (is_new) reach(shown, part.group);
    }
  }

  Costs costs_;
  const lod::View& view_;
  std::deque<Shown> shown_;  // whose addresses are kept
  std::priority_queue<Pending> queue_;
  uint64_t triangles_ = 0;
};

}  // namespace

lod::View view_for_triangles(const Asset& asset, const lod::View& view, uint64_t max_triangles,
                             std::span<const Instance> instances) {
  lod::check(view);
  if (view.kind == lod::View::Kind::kLevel)
    throw Error(ErrorCode::kInvalidArgument,
                "view_for_triangles needs a view by error or by camera: levels are whole");
  for (const Instance& instance : instances)
    if (instance.mesh >= asset.meshes().size())
      throw Error(ErrorCode::kInvalidArgument,
                  "an instance is of mesh " + std::to_string(instance.mesh) +
                      ", but the asset has " + std::to_string(asset.meshes().size()));
  lod::View result = view;
  float& value = view.kind == lod::View::Kind::kError ? result.error : result.threshold;
  value = Budget(asset, view, instances).find(value, max_triangles);
  // No threshold is large enough for groups around the eye.
  return value == kInfinity ? lod::view_error(kInfinity) : result;
}

}  // namespace umbel
