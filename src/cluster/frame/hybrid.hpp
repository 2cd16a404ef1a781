// Clusters of low area in little more time than Morton runs, for any executor: the Morton order is
// divided into blocks, and a team bisects each by the surface area heuristic in its own memory
// (cluster/frame/block_bisect.hpp). Borders of blocks move to where the curve jumps farthest.
#pragma once

#include <cstdint>
#include <type_traits>

#include "base/bit_count.hpp"
#include "cluster/frame/block_bisect.hpp"
#include "cluster/frame/morton_runs.hpp"

namespace umbel::cluster {

struct BlockSizes {
  static constexpr uint32_t kMove = 512;  ///< positions among which a border can choose
  static constexpr uint32_t kSpacing = BlockLimits::kItems - kMove;

  UMBEL_HOST_DEVICE static uint32_t blocks(uint32_t count) { return runs_of(count, kSpacing); }
};

/// Finds where block i begins, by a team.
template <typename Key>
struct FindBlockBegins {
  static constexpr uint32_t kLanes = 32;
  using Shared = NothingShared;

  FrameMesh mesh;
  const Key* codes;
  uint32_t* begins;

  struct Earlier {
    UMBEL_HOST_DEVICE uint32_t operator()(uint32_t a, uint32_t b) const { return a < b ? a : b; }
  };

  template <typename Team>
  UMBEL_HOST_DEVICE void operator()(const Team& team, size_t i, Shared&) const {
    const uint32_t count = mesh.size(), blocks = BlockSizes::blocks(count);
    if (i >= blocks) {
      if (team.rank() == 0) begins[i] = count;
      return;
    }
    const auto regular = static_cast<uint32_t>(uint64_t(i) * count / blocks);
    uint32_t best = BlockSizes::kMove / 2;  // unmoved
    if (i > 0) {
      const uint32_t begin = regular - BlockSizes::kMove / 2;
      uint32_t least = ~0u;
      for (uint32_t k = team.rank(); k < BlockSizes::kMove; k += team.size()) {
        const Key difference = codes[begin + k - 1] ^ codes[begin + k];
        const auto common = leading_zeros(difference);
        const uint32_t rank = common * BlockSizes::kMove + k;
        least = rank < least ? rank : least;
      }
      best = team.reduce(least, Earlier{}) % BlockSizes::kMove;
    }
    if (team.rank() == 0) begins[i] = regular + best - BlockSizes::kMove / 2;
  }
};

/// Bisects block i: writes its triangles' indices in cluster order, and flags where clusters begin.
template <typename Bin>
struct BisectBlock {
  static constexpr uint32_t kLanes = 256;
  using Shared = BlockMemory<Bin>;

  FrameMesh mesh;
  BlockConstraints constraints;
  const uint32_t* begins;
  const uint32_t* indices;
  uint32_t* ordered;
  uint8_t* first;

  template <typename Team>
  UMBEL_HOST_DEVICE void operator()(const Team& team, size_t block, Shared& memory) const {
    const uint32_t begin = begins[block], count = begins[block + 1] - begin;
    if (count == 0) return;
    const uint32_t* of_block = indices + begin;
    const Aabb bounds =
        gather_box(team, mesh, of_block, count, [&](uint32_t i) { first[begin + i] = 0; });
    const BlockGrid grid = BlockGrid::over(bounds);
    BlockBox root = grid.round(bounds);
    root.keep_within(BlockGrid::whole());
    for (uint32_t i = team.rank(); i < count; i += team.size()) {
      BlockBox item = grid.round(mesh, of_block[i]);
      item.keep_within(root);
      memory.items[i] = item;
    }
    BlockBisector<Team, Bin>(team, constraints, memory).run(count, root, [&](uint32_t i) {
      first[begin + i] = 1;
    });
    for (uint32_t i = team.rank(); i < count; i += team.size())
      ordered[begin + i] = of_block[memory.order[i]];
  }
};

/// Orders triangles into clusters of constraints.min_items to constraints.max_items, except for one
/// where there are fewer triangles in all, and flags where clusters begin.
template <typename Key, typename Exec>
void bisect_blocks(Exec& exec, const FrameMesh& mesh, const TriangleOrder<Exec, Key>& order,
                   const BlockConstraints& constraints, uint32_t* ordered, uint8_t* first) {
  using Bin = std::conditional_t<Exec::kSerialTeams, BlockBox, WideBox>;
  const uint32_t blocks = BlockSizes::blocks(mesh.count);
  const auto begins = exec.template allocate<uint32_t>(size_t(blocks) + 1);
  exec.for_each_team(size_t(blocks) + 1,
                     FindBlockBegins<Key>{mesh, order.codes.data(), begins.data()});
  exec.for_each_team(blocks, BisectBlock<Bin>{mesh, constraints, begins.data(),
                                              order.indices.data(), ordered, first});
}

}  // namespace umbel::cluster
