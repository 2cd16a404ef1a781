// Full-sweep SAH for any executor: the same choices as sweep_sah.cpp, a level at a time, one team a
// range, over items that may stand for many primitives. Items are sorted once an axis, and
// partitions keep the orders (Wald & Havran, "On building fast kd-trees for ray tracing, and on
// doing that in O(N log N)", 2006). Small ranges are finished by the team that finds them.
//
// The merge that divides items at a position has the number of that position, so that the same
// bytes come out whatever the order in which ranges are done.
#pragma once

#include "base/radix_sort.hpp"
#include "bvh/tree/merge_tree.hpp"

namespace umbel::bvh {

/// What a tree is built above: subtrees with their boxes.
struct SweepItems {
  const Aabb* boxes;
  const uint32_t* counts;   ///< primitives of each; null: one
  const Subtree* subtrees;  ///< null: item i is primitive i
  const uint32_t* ids;      ///< of the merge at each position from 1 on; null: position - 1

  UMBEL_HOST_DEVICE uint32_t count(uint32_t i) const { return counts ? counts[i] : 1; }
  UMBEL_HOST_DEVICE Subtree subtree(uint32_t i) const {
    return subtrees ? subtrees[i] : Subtree::of_primitive(i);
  }
  UMBEL_HOST_DEVICE uint32_t id(uint32_t position) const {
    return ids ? ids[position] : position - 1;
  }
};

/// A range of items, of at least two, and where the merge that it becomes is to be put.
struct SweepTask {
  uint32_t begin, end;
  uint32_t parent;  ///< a merge; kNone for the root
  uint32_t is_right;
};

struct SweepArrays {
  uint32_t* orders[3];  ///< items along each axis
  uint32_t* spare[3];
  float* right_areas[3];
  uint8_t* is_left;
};

/// Divides ranges. One team a task, or for small ones all that is below.
struct SweepRange {
  static constexpr uint32_t kLanes = 256;
  static constexpr uint32_t kSmall = 256;  ///< items of a range that is finished at once

  struct Choice {
    float cost;
    uint32_t axis, position;
  };
  struct Shared {
    Aabb boxes[kLanes];
    uint32_t sums[kLanes];
    SweepTask open[16];  ///< the larger of two waits, so there are few
    uint32_t open_count;
  };

  SweepItems items;
  SweepArrays arrays;
  Merge* merges;
  Subtree* root;
  bool halves;  ///< whatever the cost
  const SweepTask* tasks;
  const uint32_t* task_count;
  SweepTask* next;
  uint32_t* next_count;

  template <typename Team>
  UMBEL_HOST_DEVICE void operator()(const Team& team, size_t index, Shared& shared) const {
    if (index >= *task_count) return;
    const SweepTask task = tasks[index];
    if (task.end - task.begin > kSmall) {
      SweepTask parts[2];
      divide(team, task, shared, parts);
      if (team.rank() != 0) return;
      for (const SweepTask& part : parts)
        if (part.end - part.begin > 1) next[atomic_count(next_count)] = part;
      return;
    }
    if (team.rank() == 0) {
      shared.open[0] = task;
      shared.open_count = 1;
    }
    team.sync();
    while (shared.open_count > 0) {
      const SweepTask range = shared.open[shared.open_count - 1];
      SweepTask parts[2];
      divide(team, range, shared, parts);  // after which all lanes have read what is open
      if (team.rank() == 0) {
        --shared.open_count;
        const bool left_is_larger = parts[0].end - parts[0].begin > parts[1].end - parts[1].begin;
        for (const SweepTask& part : {parts[left_is_larger ? 0 : 1], parts[left_is_larger ? 1 : 0]})
          if (part.end - part.begin > 1) shared.open[shared.open_count++] = part;
      }
      team.sync();
    }
  }

 private:
  /// The items of a lane: as many for each, one after the other.
  template <typename Team>
  UMBEL_HOST_DEVICE Range part_of(const Team& team, const SweepTask& task) const {
    const uint32_t n = task.end - task.begin, each = (n + team.size() - 1) / team.size();
    const uint32_t from = each * team.rank() < n ? each * team.rank() : n;
    return {task.begin + from, each < n - from ? each : n - from};
  }

  /// What op makes of the values of all lanes before this one (or behind it), in any order.
  template <typename Team, typename T, typename Op>
  UMBEL_HOST_DEVICE T scan(const Team& team, T* values, const T& own, bool from_behind, T init,
                           const Op& op) const {
    const uint32_t rank = from_behind ? team.size() - 1 - team.rank() : team.rank();
    T sum = own;
    values[rank] = own;
    team.sync();
    for (uint32_t step = 1; step < team.size(); step *= 2) {
      const T other = rank >= step ? values[rank - step] : init;
      team.sync();
      sum = op(sum, other);
      values[rank] = sum;
      team.sync();
    }
    const T before = rank > 0 ? values[rank - 1] : init;
    team.sync();
    return before;
  }

  template <typename Team>
  UMBEL_HOST_DEVICE void divide(const Team& team, const SweepTask& task, Shared& shared,
                                SweepTask parts[2]) const {
    const uint32_t n = task.end - task.begin;
    const Range own = part_of(team, task);
    Aabb box;
    uint32_t count = 0;
    for (uint32_t i = own.offset; i < own.offset + own.count; ++i) {
      const uint32_t item = arrays.orders[0][i];
      extend(box, items.boxes[item]);
      count += items.count(item);
    }
    const auto unite = [](Aabb a, const Aabb& b) { return united(a, b); };
    const auto add = [](uint32_t a, uint32_t b) { return a + b; };
    const Aabb whole = team.reduce(box, unite);
    const uint32_t all = team.reduce(count, add);
    Choice best{std::numeric_limits<float>::infinity(), 0, n / 2};
    if (!halves && n > 2) best = cheapest(team, task, whole, all, shared);
    partition(team, task, best, shared);
    const uint32_t middle = task.begin + best.position, id = items.id(middle);
    parts[0] = {task.begin, middle, id, 0};
    parts[1] = {middle, task.end, id, 1};
    if (team.rank() == 0) {
      merges[id].box = whole;
      merges[id].count = all;
      if (task.parent == kNone)
        *root = Subtree::of_merge(id);
      else
        (task.is_right ? merges[task.parent].right : merges[task.parent].left) =
            Subtree::of_merge(id);
      if (best.position == 1) merges[id].left = items.subtree(arrays.orders[0][task.begin]);
      if (best.position + 1 == n) merges[id].right = items.subtree(arrays.orders[0][middle]);
    }
  }

  /// Grows with a little padding, which makes boxes without area comparable by their length.
  UMBEL_HOST_DEVICE static float padded_area(const Aabb& b, float pad) {
    const float x = b.max.x - b.min.x + pad, y = b.max.y - b.min.y + pad,
                z = b.max.z - b.min.z + pad;
    return x * y + y * z + z * x;
  }
  UMBEL_HOST_DEVICE static float pad_of(const Aabb& b) {
    const Vec3 e = b.max - b.min;
    const float xy = e.x > e.y ? e.x : e.y;
    return (xy > e.z ? xy : e.z) * 0x1p-22f;
  }

  template <typename Team>
  UMBEL_HOST_DEVICE Choice cheapest(const Team& team, const SweepTask& task, const Aabb& whole,
                                    uint32_t all, Shared& shared) const {
    const uint32_t n = task.end - task.begin;
    const float pad = pad_of(whole);
    const auto cheaper = [](const Choice& a, const Choice& b) {
      const bool second =
          b.cost < a.cost ||
          (b.cost == a.cost && (b.axis < a.axis || (b.axis == a.axis && b.position < a.position)));
      return second ? b : a;
    };
    Choice best{std::numeric_limits<float>::infinity(), 3, n / 2};
    for (uint32_t axis = 0; axis < 3; ++axis)
      best = cheaper(best, sweep(team, task, axis, all, pad, shared));
    best = team.reduce(best, cheaper);
    // Where nothing is gained, all positions cost the same, up to rounding.
    if (!(best.cost < padded_area(whole, pad) * float(all) * 0.99999f))
      best = {best.cost, best.axis, n / 2};
    if (best.axis > 2) best.axis = 0;
    return best;
  }

  template <typename Team>
  UMBEL_HOST_DEVICE Choice sweep(const Team& team, const SweepTask& task, uint32_t axis,
                                 uint32_t all, float pad, Shared& shared) const {
    const uint32_t* order = arrays.orders[axis];
    float* right_areas = arrays.right_areas[axis];
    const Range own = part_of(team, task);
    const auto unite = [](Aabb a, const Aabb& b) { return united(a, b); };
    const auto add = [](uint32_t a, uint32_t b) { return a + b; };
    Aabb box;
    uint32_t count = 0;
    for (uint32_t i = own.offset; i < own.offset + own.count; ++i) {
      extend(box, items.boxes[order[i]]);
      count += items.count(order[i]);
    }
    Aabb right = scan(team, shared.boxes, box, true, Aabb{}, unite);
    Aabb left = scan(team, shared.boxes, box, false, Aabb{}, unite);
    uint32_t before = scan(team, shared.sums, count, false, uint32_t{0}, add);
    for (uint32_t i = own.offset + own.count; i-- > own.offset;) {
      extend(right, items.boxes[order[i]]);
      right_areas[i] = padded_area(right, pad);
    }
    Choice best{std::numeric_limits<float>::infinity(), 3, 0};
    for (uint32_t i = own.offset; i < own.offset + own.count; ++i) {
      if (i > task.begin) {
        const float cost =
            padded_area(left, pad) * float(before) + right_areas[i] * float(all - before);
        if (cost < best.cost) best = {cost, axis, i - task.begin};
      }
      extend(left, items.boxes[order[i]]);
      before += items.count(order[i]);
    }
    return best;
  }

  /// All lanes see the first order when it is done, and the others after their next sync.
  template <typename Team>
  UMBEL_HOST_DEVICE void partition(const Team& team, const SweepTask& task, const Choice& choice,
                                   Shared& shared) const {
    const Range own = part_of(team, task);
    const uint32_t middle = task.begin + choice.position;
    const uint32_t* chosen = arrays.orders[choice.axis];
    for (uint32_t i = own.offset; i < own.offset + own.count; ++i)
      arrays.is_left[chosen[i]] = i < middle ? 1 : 0;
    team.sync();
    const auto add = [](uint32_t a, uint32_t b) { return a + b; };
    for (uint32_t axis = 0; axis < 3; ++axis) {
      if (axis == choice.axis) continue;
      uint32_t* order = arrays.orders[axis];
      uint32_t* spare = arrays.spare[axis];
      uint32_t lefts = 0;
      for (uint32_t i = own.offset; i < own.offset + own.count; ++i)
        lefts += arrays.is_left[order[i]];
      uint32_t left = task.begin + scan(team, shared.sums, lefts, false, uint32_t{0}, add);
      uint32_t right = middle + (own.offset - left);
      for (uint32_t i = own.offset; i < own.offset + own.count; ++i)
        spare[arrays.is_left[order[i]] ? left++ : right++] = order[i];
      team.sync();
      for (uint32_t i = own.offset; i < own.offset + own.count; ++i) order[i] = spare[i];
    }
  }
};

/// The tree above items, of which there are *count (at least one), at most `most`: its merges and
/// its root.
template <typename Exec>
void sweep_merges(Exec& exec, const SweepItems& items, const uint32_t* count, uint32_t most,
                  Merge* merges, Subtree* root) {
  using Keys = typename Exec::template Buffer<uint32_t>;
  using Areas = typename Exec::template Buffer<float>;
  Keys orders[3], spare[3];
  Areas right_areas[3];
  SweepArrays arrays{};
  for (int axis = 0; axis < 3; ++axis) {
    orders[axis] = exec.template allocate<uint32_t>(most);
    spare[axis] = exec.template allocate<uint32_t>(most);
    right_areas[axis] = exec.template allocate<float>(most);
    arrays.orders[axis] = orders[axis].data();
    arrays.spare[axis] = spare[axis].data();
    arrays.right_areas[axis] = right_areas[axis].data();
    exec.for_each(most, [=] UMBEL_DEVICE_LAMBDA(size_t i) {
      const auto item = static_cast<uint32_t>(i);
      arrays.orders[axis][i] = item;
      if (item >= *count) {
        arrays.spare[axis][i] = 0xffffffffu;  // behind the others
        return;
      }
      const Vec3 center = items.boxes[i].min + items.boxes[i].max;
      arrays.spare[axis][i] = float_to_key(axis == 0 ? center.x : axis == 1 ? center.y : center.z);
    });
    exec.radix_sort_pairs(most, arrays.spare[axis], arrays.orders[axis], 0u, 32u);
  }
  auto is_left = exec.template allocate<uint8_t>(most);
  arrays.is_left = is_left.data();
  const uint32_t most_tasks = most / 2 + 1;
  auto list = exec.template allocate<SweepTask>(most_tasks);
  auto other = exec.template allocate<SweepTask>(most_tasks);
  // Levels that are divided by cost, and then those that are halved until they are small.
  constexpr uint32_t kFreeLevels = 24;
  uint32_t levels = kFreeLevels + 1;
  while (uint64_t{SweepRange::kSmall} << (levels - kFreeLevels - 1) < most) ++levels;
  auto counts = exec.template allocate<uint32_t>(levels + 1);
  exec.for_each(1, [=, list = list.data(), counts = counts.data()] UMBEL_DEVICE_LAMBDA(size_t) {
    for (uint32_t i = 0; i <= levels; ++i) counts[i] = 0;
    if (*count == 1) *root = items.subtree(0);
    if (*count < 2) return;
    counts[0] = 1;
    list[0] = {0, *count, kNone, 0};
  });
  uint64_t bound = 1;
  for (uint32_t level = 0; level < levels; ++level) {
    const bool is_even = level % 2 == 0;
    exec.for_each_team_of(counts.data() + level, static_cast<uint32_t>(bound),
                          SweepRange{items, arrays, merges, root, level >= kFreeLevels,
                                     (is_even ? list : other).data(), counts.data() + level,
                                     (is_even ? other : list).data(), counts.data() + level + 1});
    bound = bound * 2 < most_tasks ? bound * 2 : most_tasks;
  }
}

}  // namespace umbel::bvh
