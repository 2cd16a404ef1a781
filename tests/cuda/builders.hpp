// The builders of trees that are written over an executor, for any executor.
#pragma once

#include <vector>

#include "base/morton.hpp"
#include "bvh/ploc.hpp"
#include "bvh/radix_merges.hpp"
#include "bvh/treelet.hpp"

namespace umbel::cuda {

template <typename Exec>
bvh::Subtree run_lbvh(Exec& exec, const Aabb* boxes, uint32_t n, bvh::Merge* merges) {
  const auto order = morton_order<uint64_t>(exec, boxes, n, 21);
  return bvh::radix_merges(exec, order.codes.data(), order.primitives.data(), boxes, n, merges);
}

template <typename Exec>
bvh::Subtree run_atrbvh(Exec& exec, const Aabb* boxes, uint32_t n, bvh::Merge* merges) {
  const bvh::Subtree root = run_lbvh(exec, boxes, n, merges);
  bvh::TreeletRounds<Exec> rounds(exec, bvh::TreeletInput{boxes, nullptr, n, merges}, root,
                                  bvh::LeafRule(bvh::Config{}));
  for (int i = 0; i < 2; ++i) rounds.run_round(9);
  return root;
}

template <typename Exec>
bvh::Subtree run_ploc(Exec& exec, const Aabb* boxes, uint32_t n, bvh::Merge* merges) {
  return bvh::Ploc<Exec>().run(exec, boxes, n, 16, merges);
}

enum class Builder { kLbvh, kAtrbvh, kPloc };

template <typename Exec>
bvh::Subtree run_builder(Builder builder, Exec& exec, const Aabb* boxes, uint32_t n,
                         bvh::Merge* merges) {
  if (builder == Builder::kLbvh) return run_lbvh(exec, boxes, n, merges);
  if (builder == Builder::kAtrbvh) return run_atrbvh(exec, boxes, n, merges);
  return run_ploc(exec, boxes, n, merges);
}

/// On the processor: CUDA's compiler would compile its lambdas for the device only.
bvh::Subtree run_on_processor(Builder builder, const std::vector<Aabb>& boxes,
                              std::vector<bvh::Merge>& merges);

}  // namespace umbel::cuda
