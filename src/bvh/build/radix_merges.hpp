// The radix tree over sorted Morton codes for any executor (Apetrei, "Fast and Simple Agglomerative
// LBVH Construction", 2014): subtrees climb from the leaves, and of the two that meet at a node the
// second one makes it, with its box, and climbs on.
//
// A team takes a chunk of codes, and makes in shared memory what has no code of another chunk, in
// rounds of all nodes whose children are done: no lane is without work while others climb, and
// nothing is waited for but the team. Few subtrees are left, which climb on by themselves and meet
// those of other chunks in global memory, by one atomic operation a node.
#pragma once

#include <cstdint>
#include <cstring>

#include "base/exec.hpp"
#include "bvh/build/radix_splits.hpp"
#include "bvh/tree/merge_sums.hpp"

namespace umbel::bvh {

/// Codes of a chunk, on a device; on a processor a chunk fits into the first cache. The emulator of
/// tests/simt has fewer, so that small meshes have several chunks.
#if !defined(UMBEL_CHUNK_CODES)
#define UMBEL_CHUNK_CODES 512
#endif

/// Node i, and merge i, is where the codes i and i + 1 part. A chunk has kCodes codes.
template <typename Sums, uint32_t kCodes>
struct RadixTeams {
  static constexpr uint32_t kLanes = 128;

  /// A subtree as it waits at the node above it.
  struct Below {
    static constexpr uint32_t kMissing = 0xffffffffu;
    uint32_t word;

    UMBEL_HOST_DEVICE static Below of(uint32_t far_end, uint32_t merge) {
      return {far_end << 16 | merge};
    }
    UMBEL_HOST_DEVICE bool is_missing() const { return word == kMissing; }
    UMBEL_HOST_DEVICE uint32_t far_end() const { return word >> 16; }   ///< of its codes
    UMBEL_HOST_DEVICE uint32_t merge() const { return word & 0xffff; }  ///< unless it is one code
  };
  /// Codes of the chunk, the last one included, with the merge over them if they are several.
  struct Range {
    uint32_t begin, end, merge;
  };
  enum State : uint32_t { kNobody, kOneWaits, kMade };

  /// Positions are within the chunk.
  struct Shared {
    typename Sums::template Shared<kCodes> sums;
    Merge merges[kCodes];
    Below left[kCodes], right[kCodes];  ///< of node i
    uint32_t states[kCodes];
    uint32_t list_sizes[3];
    uint16_t lists[2][kCodes];  ///< nodes whose children are done; at last those with one child
    uint32_t ends;              ///< subtrees that are below nodes of no single chunk
    Range at_ends[2];
    uint8_t common[kCodes + 1];  ///< 1 + bits of the code i and of that before it; 0: it is alone
  };

  const uint64_t* codes;
  const uint32_t* primitives;
  const Aabb* boxes;
  uint32_t n;
  uint64_t* met;  ///< of each node that chunks share: the far end of the first child, and its link
  Merge* merges;
  Subtree* root;
  Sums sums;

  template <typename Team>
  UMBEL_HOST_DEVICE void operator()(const Team& team, size_t index, Shared& shared) const {
    const auto first = static_cast<uint32_t>(index * kCodes);
    const uint32_t count = n - first < kCodes ? n - first : kCodes;
    for (uint32_t i = team.rank(); i <= count; i += team.size()) {
      const bool has_both = first + i > 0 && first + i < n;
      shared.common[i] =
          has_both ? static_cast<uint8_t>(1 + common_bits(codes, first + i - 1, first + i)) : 0;
      if (i == count) continue;
      shared.left[i] = shared.right[i] = {Below::kMissing};
      shared.states[i] = kNobody;
    }
    for (uint32_t i = team.rank(); i < 3; i += team.size()) shared.list_sizes[i] = 0;
    if (team.rank() == 0) shared.ends = 0;
    team.sync();
    for (uint32_t i = team.rank(); i < count; i += team.size())
      go_up(team, {i, i, 0}, count, 0, shared);
    team.sync();
    const auto own_sums = sums.within(shared.sums, first);
    uint32_t round = 0;
    for (; shared.list_sizes[round % 3] > 0; ++round) {
      const uint32_t ready = shared.list_sizes[round % 3];
      // The size that all have read before the last sync().
      if (team.rank() == 0) shared.list_sizes[(round + 2) % 3] = 0;
      for (uint32_t i = team.rank(); i < ready; i += team.size()) {
        const uint32_t node = shared.lists[round % 2][i];
        const Range range = make(node, first, own_sums, shared);
        go_up(team, range, count, round + 1, shared);
      }
      team.sync();
    }
    uint32_t* waiting_size = &shared.list_sizes[(round + 1) % 3];  // 0, and nobody looks at it
    for (uint32_t i = team.rank(); i < count; i += team.size())
      if (shared.states[i] == kOneWaits)
        shared.lists[0][team.add(waiting_size, 1)] = static_cast<uint16_t>(i);
    copy_made(team, first, count, shared);
    own_sums.copy_to(team, count, [&](uint32_t i) { return shared.states[i] == kMade; }, sums);
    team.sync();
    const uint32_t waiting = *waiting_size, rest = waiting + shared.ends;
    for (uint32_t i = team.rank(); i < rest; i += team.size())
      climb_on(i < waiting ? waiting_at(shared.lists[0][i], shared) : shared.at_ends[i - waiting],
               first, shared);
  }

 private:
  /// To the node above, which is listed for a round if the other child is there already.
  template <typename Team>
  UMBEL_HOST_DEVICE void go_up(const Team& team, const Range& range, uint32_t count, uint32_t round,
                               Shared& shared) const {
    const uint32_t before = shared.common[range.begin], behind = shared.common[range.end + 1];
    const bool is_right = before > behind;
    if (is_right ? range.begin == 0 : range.end + 1 == count) {
      shared.at_ends[team.add(&shared.ends, 1)] = range;
      return;
    }
    const uint32_t node = is_right ? range.begin - 1 : range.end;
    (is_right ? shared.right : shared.left)[node] =
        Below::of(is_right ? range.end : range.begin, range.merge);
    if (team.claim(&shared.states[node], kNobody, kOneWaits) == kNobody) return;
    shared.lists[round % 2][team.add(&shared.list_sizes[round % 3], 1)] =
        static_cast<uint16_t>(node);
  }

  /// Makes the merge of a node, and returns what is below it.
  template <typename OwnSums>
  UMBEL_HOST_DEVICE Range make(uint32_t node, uint32_t first, const OwnSums& own_sums,
                               Shared& shared) const {
    const Below left = shared.left[node], right = shared.right[node];
    const Range range{left.far_end(), right.far_end(), node};
    Aabb left_box, right_box;
    const Subtree left_tree = look({range.begin, node, left.merge()}, first, shared, left_box);
    const Subtree right_tree = look({node + 1, range.end, right.merge()}, first, shared, right_box);
    const Merge merge{united(left_box, right_box), left_tree, right_tree,
                      range.end - range.begin + 1};
    shared.merges[node] = merge;
    own_sums.join(first + node, merge, own_sums.of(left_tree, left_box),
                  own_sums.of(right_tree, right_box));
    shared.states[node] = kMade;
    return range;
  }

  /// The subtree over a range, and its box.
  UMBEL_HOST_DEVICE Subtree look(const Range& range, uint32_t first, const Shared& shared,
                                 Aabb& box) const {
    if (range.begin == range.end) {
      const uint32_t primitive = primitives[first + range.begin];
      box = boxes[primitive];
      return Subtree::of_primitive(primitive);
    }
    box = shared.merges[range.merge].box;
    return Subtree::of_merge(first + range.merge);
  }

  /// The one child that has come to a node.
  UMBEL_HOST_DEVICE static Range waiting_at(uint32_t node, const Shared& shared) {
    const Below left = shared.left[node], right = shared.right[node];
    return left.is_missing() ? Range{node + 1, right.far_end(), right.merge()}
                             : Range{left.far_end(), node, left.merge()};
  }

  /// Words side by side, so that lanes write whole lines.
  template <typename Team>
  UMBEL_HOST_DEVICE void copy_made(const Team& team, uint32_t first, uint32_t count,
                                   const Shared& shared) const {
    constexpr uint32_t kWords = sizeof(Merge) / sizeof(uint32_t);
    const auto* from = reinterpret_cast<const char*>(shared.merges);
    auto* to = reinterpret_cast<char*>(merges + first);
    for (uint32_t i = team.rank(); i < count * kWords; i += team.size()) {
      if (shared.states[i / kWords] != kMade) continue;
      uint32_t word;
      memcpy(&word, from + size_t{i} * sizeof(word), sizeof(word));
      memcpy(to + size_t{i} * sizeof(word), &word, sizeof(word));
    }
  }

  /// By a lane alone. What it made itself it keeps in registers.
  UMBEL_HOST_DEVICE void climb_on(const Range& range, uint32_t first, const Shared& shared) const {
    RadixClimb climb = RadixClimb::from(codes, n, first + range.begin, first + range.end);
    Aabb box;
    Subtree own = look(range, first, shared, box);
    typename Sums::Sum sum = sums.of(own, box);
    while (!climb.is_all()) {
      const bool is_right = climb.is_right();
      const uint32_t parent = climb.parent();
      uint64_t left_there = 0;
      if (!is_second_to_meet(&met[parent], uint64_t{climb.far_end()} << 32 | own.link, left_there))
        return;
      climb.go_up(static_cast<uint32_t>(left_there >> 32));
      const Subtree other{static_cast<uint32_t>(left_there)};
      const Aabb other_box =
          other.is_primitive() ? boxes[other.index()] : merges[other.index()].box;
      const typename Sums::Sum other_sum = sums.of(other, other_box);
      const Merge merge{is_right ? united(other_box, box) : united(box, other_box),
                        is_right ? other : own, is_right ? own : other, climb.count()};
      merges[parent] = merge;
      sum = is_right ? sums.join(parent, merge, other_sum, sum)
                     : sums.join(parent, merge, sum, other_sum);
      own = Subtree::of_merge(parent);
      box = merge.box;
    }
    *root = own;
  }
};

/// Writes the n - 1 merges of n > 0 codes, merge i where the codes i and i + 1 part, and the root.
template <typename Exec, typename Sums = NoMergeSums>
void radix_merges(Exec& exec, const uint64_t* codes, const uint32_t* primitives, const Aabb* boxes,
                  uint32_t n, Merge* merges, Subtree* root, const Sums& sums = {}) {
  constexpr uint32_t kCodes = Exec::kSerialTeams ? 256 : UMBEL_CHUNK_CODES;
  auto met = exec.template allocate<uint64_t>(n);
  exec.for_each(n, [met = met.data()] UMBEL_DEVICE_LAMBDA(size_t i) { met[i] = kNobodyMet; });
  exec.for_each_team(
      (n + size_t{kCodes} - 1) / kCodes,
      RadixTeams<Sums, kCodes>{codes, primitives, boxes, n, met.data(), merges, root, sums});
}

}  // namespace umbel::bvh
