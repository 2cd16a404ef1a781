// Selection for many instances at once, for any executor: breadth-first through the hierarchy, with
// a queue of the nodes whose children are visited next (Karis, "Nanite: A Deep Dive", 2021, has a
// persistent-threads form).
//
// The queue is in no particular order. It sets a bit for each group that an instance shows, and
// the results are in the order of the bits: instances, then groups, then clusters.
#pragma once

#include <bit>
#include <cstdint>
#include <limits>

#include "base/bit_count.hpp"
#include "base/exec.hpp"
#include "lod/select/cull.hpp"
#include "lod/select/instances.hpp"
#include "umbel/cuda_select.hpp"

namespace umbel::cuda {

// Of DevicePages::states.
enum : uint32_t {
  kHasCoarser = 1,  // a cluster was made from the group
  kReachable = 2,   // one of the groups made from it can be shown
  kBlocked = 4,     // one of them cannot
  kCanBeShown = 8,
};

UMBEL_HOST_DEVICE inline uint32_t bits_of(float value) { return std::bit_cast<uint32_t>(value); }

/// A node of an instance whose children come next.
struct QueuedNode {
  uint32_t instance, node;
};

/// A group that an instance shows, and which of its clusters.
struct ShownGroup {
  uint32_t instance, group;
};

/// What every step of a selection reads and writes.
struct Selecting {
  static constexpr uint32_t kLanes = 8;  ///< that share a queued node: as many as children

  DeviceTables tables;
  DeviceScene scene;
  DevicePages pages;
  lod::View* views;    ///< one an instance, in its own space
  lod::Plane* planes;  ///< plane_count an instance, likewise
  uint32_t* bits;      ///< words() an instance: the groups that it shows
  QueuedNode* queues[2];
  uint32_t* lengths;  ///< of the queue, a layer each
  SelectionCounts* counts;
  uint32_t* urgencies;  ///< bits of floats at least 0, which are in the floats' order
  uint32_t queue_room;

  UMBEL_HOST_DEVICE uint32_t words() const { return (tables.group_count + 31) / 32; }
  UMBEL_HOST_DEVICE size_t all_words() const { return size_t(words()) * scene.instance_count; }
  UMBEL_HOST_DEVICE std::span<const lod::Plane> planes_of(uint32_t instance) const {
    return {planes + size_t(instance) * scene.plane_count, scene.plane_count};
  }

  UMBEL_HOST_DEVICE bool can_be_shown(uint32_t group) const {
    return !pages.page_of_group || (pages.states[group] & kCanBeShown) != 0;
  }

  UMBEL_HOST_DEVICE bool must_refine(uint32_t group, const lod::View& view) const {
    const lod::Group& g = tables.groups[group];
    return lod::must_refine(g.sphere, g.error, g.level, view);
  }

  /// Marks the group of a leaf if the instance shows it, and wants its page.
  UMBEL_HOST_DEVICE void visit_group(uint32_t instance, uint32_t index) const {
    const lod::Group& group = tables.groups[index];
    const lod::View& view = views[instance];
    if (!must_refine(index, view) || lod::is_outside(group.sphere, planes_of(instance))) return;
    if (pages.page_of_group) {
      const uint32_t state = pages.states[index];
      if (urgencies && (state & kReachable || !(state & kHasCoarser)))
        atomic_max(&urgencies[pages.page_of_group[index]],
                   bits_of(lod::times_too_large(group.sphere, group.error, view)));
      if (!(state & kCanBeShown)) return;
    }
    atomic_or(&bits[size_t(instance) * words() + index / 32], 1u << index % 32);
  }

  /// A node of layer `layer`: those below it come in the next.
  UMBEL_HOST_DEVICE void visit(uint32_t instance, uint32_t index, uint32_t layer) const {
    const lod::Node& node = tables.nodes[index];
    if (node.group != kNone) {
      visit_group(instance, node.group);
    } else if (lod::must_descend(node, views[instance], planes_of(instance))) {
      const uint32_t at = atomic_count(&lengths[layer]);
      if (at < queue_room) queues[layer % 2][at] = {instance, index};
    }
  }
};

/// Brings view and planes into an instance's space, and visits the root.
struct StartInstance {
  Selecting s;

  UMBEL_HOST_DEVICE void operator()(size_t i) const {
    const lod::InstanceSpace space(s.scene.instances[i]);
    const lod::View view = space.view(*s.scene.view);
    if (!space.is_invertible() || (view.kind == lod::View::Kind::kCamera && !is_finite(view.eye))) {
      atomic_count(&s.counts->refused);
      return;
    }
    s.views[i] = view;
    for (uint32_t p = 0; p < s.scene.plane_count; ++p)
      s.planes[i * s.scene.plane_count + p] = space.plane(s.scene.planes[p]);
    s.visit(uint32_t(i), 0, 0);
  }
};

/// Lanes of a queued node visit its children.
struct VisitChildren {
  Selecting s;

  UMBEL_HOST_DEVICE void operator()(uint32_t layer, size_t i) const {
    const QueuedNode at = s.queues[layer % 2][i / Selecting::kLanes];
    const Range children = s.tables.nodes[at.node].children;
    for (uint32_t k = i % Selecting::kLanes; k < children.count; k += Selecting::kLanes)
      s.visit(at.instance, children.offset + k, layer + 1);
  }
};

/// The clusters of a shown group that are in the cut. Calls take(cluster) in their order.
template <typename Take>
UMBEL_HOST_DEVICE void each_cluster(const Selecting& s, const ShownGroup& shown, const Take& take) {
  const Range range = s.tables.groups[shown.group].clusters;
  const lod::View& view = s.views[shown.instance];
  const auto planes = s.planes_of(shown.instance);
  // Clusters made from the same group stand together, so the last answer often holds.
  uint32_t asked = kNone;
  bool is_finer_shown = false;
  for (uint32_t c = range.offset; c < range.offset + range.count; ++c) {
    const lod::Cluster& cluster = s.tables.clusters[c];
    const uint32_t from = cluster.generating_group;
    if (from != asked) {
      is_finer_shown = from != kNone && s.can_be_shown(from) && s.must_refine(from, view);
      asked = from;
    }
    if (is_finer_shown || lod::is_outside(cluster.box, planes)) continue;
    if (s.tables.normal_cones && lod::faces_away(s.tables.normal_cones[c], view.eye)) continue;
    take(c);
  }
}

/// Groups of a selection in order, with their clusters.
struct ShownGroups {
  ShownGroup* groups;
  const uint32_t* starts;  ///< one a word of bits, and the total
  uint32_t* sizes;         ///< clusters of each
  uint64_t* cluster_starts;
  uint32_t room;
};

struct ListGroups {
  Selecting s;
  ShownGroups shown;

  UMBEL_HOST_DEVICE void operator()(size_t word) const {
    uint32_t at = shown.starts[word];
    const auto instance = uint32_t(word / s.words());
    for (uint32_t bits = s.bits[word]; bits; bits &= bits - 1, ++at)
      if (at < shown.room)
        shown.groups[at] = {instance, uint32_t(word % s.words()) * 32 + lowest_bit(bits)};
  }
};

struct CountClusters {
  Selecting s;
  ShownGroups shown;

  UMBEL_HOST_DEVICE void operator()(size_t i) const {
    uint32_t size = 0;
    each_cluster(s, shown.groups[i], [&](uint32_t) { ++size; });
    shown.sizes[i] = size;
  }
};

/// How much there was, and where each instance's cut begins.
struct FinishCuts {
  Selecting s;
  ShownGroups shown;
  SelectionRoom room;
  uint32_t* offsets;

  UMBEL_HOST_DEVICE uint32_t overflow(uint32_t& queue) const {
    for (uint32_t layer = 0; layer < s.tables.layers; ++layer)
      if (s.lengths[layer] > queue) queue = s.lengths[layer];
    uint32_t result = queue > room.queue ? kQueueFull : 0u;
    if (s.counts->groups > room.groups) result |= kGroupsFull;
    if (shown.cluster_starts[shown.room] > room.clusters) result |= kClustersFull;
    return result;
  }
  UMBEL_HOST_DEVICE void operator()(size_t instance) const {
    uint32_t queue = 0;
    const uint32_t what = overflow(queue);
    offsets[instance] =
        what ? 0 : uint32_t(shown.cluster_starts[shown.starts[instance * s.words()]]);
    if (instance > 0) return;
    const uint64_t clusters = shown.cluster_starts[shown.room];
    s.counts->queue = queue;
    s.counts->clusters = uint32_t(clusters < kNone ? clusters : kNone);
    s.counts->overflow = what;
  }
};

struct WriteClusters {
  Selecting s;
  ShownGroups shown;
  uint32_t* clusters;

  UMBEL_HOST_DEVICE void operator()(size_t i) const {
    if (s.counts->overflow) return;
    uint32_t* out = clusters + shown.cluster_starts[i];
    if (shown.sizes[i] == 0) return;
    each_cluster(s, shown.groups[i], [&](uint32_t cluster) { *out++ = cluster; });
  }
};

/// Everything that is added to begins at 0.
struct ClearSelection {
  Selecting s;

  UMBEL_HOST_DEVICE void operator()(size_t i) const {
    if (i < s.all_words()) s.bits[i] = 0;
    if (i < s.tables.layers) s.lengths[i] = 0;
    if (s.urgencies && i < s.pages.page_count) s.urgencies[i] = 0;
    if (i == 0) *s.counts = {};
  }
};

template <typename Exec>
void list_cuts(Exec& exec, const Selecting& s, const SelectionRoom& room,
               const DeviceSelection& out) {
  const auto starts = exec.template allocate<uint32_t>(s.all_words() + 1);
  const auto groups = exec.template allocate<ShownGroup>(room.groups);
  const auto sizes = exec.template allocate<uint32_t>(room.groups);
  const auto cluster_starts = exec.template allocate<uint64_t>(size_t(room.groups) + 1);
  const ShownGroups shown{groups.data(), starts.data(), sizes.data(), cluster_starts.data(),
                          room.groups};
  exec.template exclusive_scan<uint32_t>(
      s.all_words(), [bits = s.bits] UMBEL_DEVICE_LAMBDA(size_t i) { return count_bits(bits[i]); },
      starts.data());
  exec.for_each(s.all_words(), ListGroups{s, shown});
  uint32_t* count = &out.counts->groups;
  exec.for_each(1, [count, total = starts.data() + s.all_words()] UMBEL_DEVICE_LAMBDA(size_t) {
    *count = *total;
  });
  exec.for_each_of(count, room.groups, 1, CountClusters{s, shown});
  exec.template exclusive_scan<uint64_t>(
      room.groups,
      [count, sizes = shown.sizes] UMBEL_DEVICE_LAMBDA(size_t i) {
        return i < *count ? uint64_t(sizes[i]) : uint64_t(0);
      },
      cluster_starts.data());
  exec.for_each(size_t(s.scene.instance_count) + 1, FinishCuts{s, shown, room, out.offsets});
  exec.for_each_of(count, room.groups, 1, WriteClusters{s, shown, out.clusters});
}

/// select_instances of cuda_select.hpp, on any executor.
template <typename Exec>
void select_by_queue(Exec& exec, const DeviceTables& tables, const DeviceScene& scene,
                     const DevicePages& pages, const SelectionRoom& room,
                     const DeviceSelection& out, const DeviceFeedback& feedback) {
  const size_t instances = scene.instance_count;
  const auto views = exec.template allocate<lod::View>(instances);
  const auto planes = exec.template allocate<lod::Plane>(instances * scene.plane_count);
  const auto bits = exec.template allocate<uint32_t>(instances * ((tables.group_count + 31) / 32));
  const auto even = exec.template allocate<QueuedNode>(room.queue);
  const auto odd = exec.template allocate<QueuedNode>(room.queue);
  const auto lengths = exec.template allocate<uint32_t>(tables.layers);
  auto* urgencies = reinterpret_cast<uint32_t*>(feedback.urgencies);
  const Selecting s{tables,
                    scene,
                    pages,
                    views.data(),
                    planes.data(),
                    bits.data(),
                    {even.data(), odd.data()},
                    lengths.data(),
                    out.counts,
                    urgencies,
                    room.queue};
  const size_t cleared = std::max<size_t>({s.all_words(), tables.layers, pages.page_count, 1});
  exec.for_each(cleared, ClearSelection{s});
  if (tables.layers > 0) exec.for_each(instances, StartInstance{s});
  if (tables.layers > 1)
    exec.for_each_layer(lengths.data(), tables.layers - 1, room.queue, Selecting::kLanes,
                        VisitChildren{s});
  list_cuts(exec, s, room, out);
  if (!urgencies || !feedback.requests) return;
  exec.select(
      pages.page_count,
      [urgencies, resident = pages.resident] UMBEL_DEVICE_LAMBDA(size_t page) {
        return urgencies[page] != 0 && !resident[page];
      },
      feedback.requests, &out.counts->requests);
}

// ---- resident groups

/// What a group's state means for the groups that its clusters were made from. All coarser levels
/// are done.
struct MarkFiner {
  DeviceTables tables;
  DevicePages pages;
  uint32_t first;

  UMBEL_HOST_DEVICE void operator()(size_t i) const {
    const uint32_t g = first + uint32_t(i);
    const bool is_shown =
        !(pages.states[g] & kBlocked) && pages.resident[pages.page_of_group[g]] != 0;
    if (is_shown) pages.states[g] |= kCanBeShown;
    const Range range = tables.groups[g].clusters;
    uint32_t marked = kNone;
    for (uint32_t c = range.offset; c < range.offset + range.count; ++c) {
      const uint32_t from = tables.clusters[c].generating_group;
      if (from == marked || from == kNone) continue;
      atomic_or(&pages.states[from], kHasCoarser | (is_shown ? kReachable : kBlocked));
      marked = from;
    }
  }
};

template <typename Exec>
void mark_groups(Exec& exec, const DeviceTables& tables, const Range* levels, uint32_t level_count,
                 const DevicePages& pages) {
  exec.for_each(tables.group_count,
                [states = pages.states] UMBEL_DEVICE_LAMBDA(size_t g) { states[g] = 0; });
  for (uint32_t l = level_count; l-- > 0;)
    exec.for_each(levels[l].count, MarkFiner{tables, pages, levels[l].offset});
}

}  // namespace umbel::cuda
