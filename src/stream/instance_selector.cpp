// Selects from a tree of instances: a node that must be refined shows what is in its page, or, if
// that is not loaded, stays as it is in its parent's.
#include <algorithm>
#include <limits>
#include <string>
#include <utility>

#include "asset/instances/placed_box.hpp"
#include "base/math.hpp"
#include "base/parallel.hpp"
#include "lod/select/cull.hpp"
#include "umbel/instance_tree.hpp"

namespace umbel {
namespace {

/// What a step must know of a placement.
struct Seen {
  Sphere sphere;
  float error;  ///< that it has with its mesh's coarsest clusters
};

struct Page {
  std::vector<Instance> placements;
  std::vector<Seen> seen;  ///< of a leaf's
  uint64_t last_step = 0;

  size_t bytes() const {
    return placements.size() * sizeof(Instance) + seen.size() * sizeof(Seen) + sizeof(Page);
  }
};

Seen seen_of(const Instance& instance, const InstancedMesh& mesh) {
  constexpr double kRoom = 1 + 1e-6;
  const asset::PlacedBox box(mesh.bounds, instance.transform);
  const Vec3d& c = box.center();
  const double error = double{mesh.coarsest_error} * asset::largest_scale(instance.transform);
  constexpr double kMost = std::numeric_limits<float>::max();
  return {{{static_cast<float>(c.x), static_cast<float>(c.y), static_cast<float>(c.z)},
           static_cast<float>(std::min(box.radius() * kRoom, kMost))},
          static_cast<float>(std::min(error, kMost))};
}

/// Whether nothing within the sphere is outside.
bool is_inside(const Sphere& sphere, std::span<const Plane> planes) {
  const Vec3& c = sphere.center;
  return std::all_of(planes.begin(), planes.end(), [&](const Plane& plane) {
    return lod::side(plane, c.x, c.y, c.z) >= sphere.radius;
  });
}

}  // namespace

struct InstanceSelector::State {
  class Selection;

  State(const Asset& from, size_t max_bytes)
      : asset(from),
        nodes(from.instance_nodes()),
        most_bytes(max_bytes == 0 ? std::numeric_limits<size_t>::max() : max_bytes),
        pages(nodes.size()) {}

  const Asset& asset;
  const std::vector<InstanceNode>& nodes;
  size_t most_bytes, bytes = 0;
  std::vector<std::unique_ptr<Page>> pages;  // one a node
  std::vector<uint32_t> loaded;
  uint64_t steps = 1;

  void insert(uint32_t node, std::unique_ptr<Page> page) {
    loaded.push_back(node);  // first, as it may fail
    page->last_step = steps;
    bytes += page->bytes();
    pages[node] = std::move(page);
  }

  /// Drops pages that the last step did not need, those that were longest not needed first.
  void evict() {
    if (bytes <= most_bytes) return;
    std::vector<std::pair<uint64_t, uint32_t>> idle;
    for (const uint32_t node : loaded)
      if (pages[node]->last_step != steps) idle.emplace_back(pages[node]->last_step, node);
    if (idle.empty()) return;
    std::sort(idle.begin(), idle.end());
    for (const auto& [last, node] : idle) {
      if (bytes <= most_bytes) break;
      bytes -= pages[node]->bytes();
      pages[node].reset();
    }
    std::erase_if(loaded, [&](uint32_t node) { return !pages[node]; });
  }
};

/// One step.
class InstanceSelector::State::Selection {
 public:
  Selection(State& state, const lod::View& view, std::span<const Plane> planes)
      : state_(state), view_(view), planes_(planes) {}

  InstanceStep run() {
    visit(0, kNone);
    std::sort(missing_.begin(), missing_.end(), [](const auto& a, const auto& b) {
      return a.first != b.first ? a.first > b.first : a.second < b.second;
    });
    for (const auto& [urgency, node] : missing_) step_.missing.push_back(node);
    return std::move(step_);
  }

 private:
  void visit(uint32_t n, uint32_t parent) {
    const InstanceNode& node = state_.nodes[n];
    if (lod::is_node_outside(node.sphere, planes_)) return;
    const bool is_finer = lod::must_refine(node.sphere, node.error, view_);
    Page* page = is_finer ? state_.pages[n].get() : nullptr;
    if (is_finer && !page)
      missing_.emplace_back(lod::times_too_large(node.sphere, node.error, view_), n);
    if (!page) {
      step_.stand_ins += node.stand_ins.count;
      show(parent, node.stand_ins, true);
      return;
    }
    page->last_step = state_.steps;
    if (node.children.count == 0) return show_leaf(n, node, *page);
    for (uint32_t c = 0; c < node.children.count; ++c) visit(node.children.offset + c, n);
  }

  void show(uint32_t node, const Range& placements, bool is_coarsest) {
    if (placements.count == 0) return;
    step_.shown += placements.count;
    if (!is_coarsest) step_.refined += placements.count;
    step_.runs.push_back({node, placements, is_coarsest});
  }

  void show_leaf(uint32_t n, const InstanceNode& node, const Page& page) {
    const bool is_coarse = !lod::must_refine(node.sphere, node.coarsest_error, view_);
    const bool is_whole = is_inside(node.sphere, planes_);
    if (is_coarse && is_whole) return show(n, {0, node.placements}, true);
    const std::span<const Plane> planes = is_whole ? std::span<const Plane>() : planes_;
    constexpr int kHidden = 0, kCoarse = 1, kFine = 2;
    int kind = kHidden;
    uint32_t first = 0;
    for (uint32_t i = 0; i < node.placements; ++i) {
      const Seen& seen = page.seen[i];
      int now = kCoarse;
      if (lod::is_outside(seen.sphere, planes))
        now = kHidden;
      else if (!is_coarse && lod::must_refine(seen.sphere, seen.error, view_))
        now = kFine;
      if (now == kind) continue;
      if (kind != kHidden) show(n, {first, i - first}, kind == kCoarse);
      kind = now;
      first = i;
    }
    if (kind != kHidden) show(n, {first, node.placements - first}, kind == kCoarse);
  }

  State& state_;
  const lod::View& view_;
  std::span<const Plane> planes_;
  std::vector<std::pair<float, uint32_t>> missing_;
  InstanceStep step_;
};

InstanceSelector::InstanceSelector(const Asset& asset, size_t max_bytes)
    : state_(std::make_unique<State>(asset, max_bytes)) {
  if (!asset.has_instance_tree())
    throw Error(ErrorCode::kInvalidArgument, "the asset has no tree of instances: it lists them");
}

InstanceSelector::InstanceSelector(InstanceSelector&&) noexcept = default;
InstanceSelector& InstanceSelector::operator=(InstanceSelector&&) noexcept = default;
InstanceSelector::~InstanceSelector() = default;

InstanceStep InstanceSelector::step(const lod::View& view, std::span<const Plane> planes) {
  lod::check({}, view, {planes, {}});
  if (view.kind == lod::View::Kind::kLevel)
    throw Error(ErrorCode::kInvalidArgument,
                "a tree of instances needs a view by error or by camera: it has no levels");
  ++state_->steps;
  InstanceStep found = State::Selection(*state_, view, planes).run();
  state_->evict();
  return found;
}

void InstanceSelector::load(std::span<const uint32_t> nodes, size_t most) {
  std::vector<uint32_t> wanted;
  for (const uint32_t node : nodes.first(std::min(most, nodes.size()))) {
    if (node >= state_->nodes.size())
      throw Error(ErrorCode::kInvalidArgument, "node " + std::to_string(node) +
                                                   " of the instances is not there: there are " +
                                                   std::to_string(state_->nodes.size()));
    if (!state_->pages[node]) wanted.push_back(node);
  }
  std::sort(wanted.begin(), wanted.end());
  wanted.erase(std::unique(wanted.begin(), wanted.end()), wanted.end());
  const std::vector<InstancedMesh>& meshes = state_->asset.instanced_meshes();
  std::vector<std::unique_ptr<Page>> made(wanted.size());
  parallel_for(wanted.size(), 1, [&](size_t k) {
    auto page = std::make_unique<Page>();
    page->placements = state_->asset.placements(wanted[k]);
    if (state_->nodes[wanted[k]].children.count == 0)
      for (const Instance& instance : page->placements)
        page->seen.push_back(seen_of(instance, meshes[instance.mesh]));
    made[k] = std::move(page);
  });
  for (size_t k = 0; k < wanted.size(); ++k) state_->insert(wanted[k], std::move(made[k]));
  state_->evict();
}

InstanceStep InstanceSelector::settle(const lod::View& view, std::span<const Plane> planes) {
  InstanceStep found = step(view, planes);
  while (!found.missing.empty()) {
    load(found.missing);
    found = step(view, planes);
  }
  return found;
}

std::span<const Instance> InstanceSelector::placements(const InstanceRun& run) const {
  const bool is_top = run.node == kNone;
  if (!is_top && (run.node >= state_->pages.size() || !state_->pages[run.node]))
    throw Error(ErrorCode::kInvalidArgument, "the page of a run is not loaded");
  const std::vector<Instance>& all =
      is_top ? state_->asset.instances() : state_->pages[run.node]->placements;
  if (run.placements.offset > all.size() ||
      run.placements.count > all.size() - run.placements.offset)
    throw Error(ErrorCode::kInvalidArgument, "a run has placements that are not in its page");
  return std::span(all).subspan(run.placements.offset, run.placements.count);
}

size_t InstanceSelector::bytes() const { return state_->bytes; }

}  // namespace umbel
