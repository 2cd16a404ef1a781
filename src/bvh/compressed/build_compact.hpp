// A compact tree from triangles, over any executor: boxes, a binary tree by the builder that the
// configuration names, and its layout. Nothing here is an algorithm: see the headers that are
// included.
#pragma once

#include <cmath>

#include "base/morton.hpp"
#include "bvh/build/hlbvh_merges.hpp"
#include "bvh/build/hploc.hpp"
#include "bvh/build/kmeans_passes.hpp"
#include "bvh/build/kmeans_treelets.hpp"
#include "bvh/build/ploc.hpp"
#include "bvh/build/presplit.hpp"
#include "bvh/build/radix_merges.hpp"
#include "bvh/compressed/cluster_order.hpp"
#include "bvh/compressed/compact_tree.hpp"
#include "bvh/optimize/treelet.hpp"
#include "cluster/frame/frame_mesh.hpp"
#include "umbel/cuda_bvh.hpp"

namespace umbel::cuda {

/// For those who do not measure.
struct NoStages {
  void operator()(const char* /*stage*/) const {}
};

struct TriangleCorners {
  Vec3 a, b, c;
};
struct MeshCorners {
  cluster::Positions positions;
  const Triangle* triangles;

  UMBEL_HOST_DEVICE TriangleCorners operator()(uint32_t i) const {
    const Triangle& t = triangles[i];
    return {positions[t[0]], positions[t[1]], positions[t[2]]};
  }
};

/// Whether a builder makes each merge once and for all, from below, and so can sum up with it.
inline bool sums_while_building(const DeviceBvhConfig& config) {
  return config.builder == DeviceBuilder::kLbvh || config.builder == DeviceBuilder::kHploc;
}

/// The binary tree of n > 0 boxes. There is room for n merges; those that are not used get a count
/// of 0, and the root. `stage` is called with the name of each stage that ends.
template <typename Exec, typename Stage, typename Sums>
void build_by_codes(Exec& exec, const DeviceBvhConfig& config, const Aabb* boxes, uint32_t n,
                    const bvh::ClusterRanges& clusters, bvh::Merge* merges, bvh::Subtree* root,
                    const Stage& stage, const Sums& sums) {
  const bool is_hlbvh = config.builder == DeviceBuilder::kHlbvh;
  const auto order = clusters.most > 0
                         ? bvh::cluster_order(exec, boxes, n, clusters)
                         : morton_order<uint64_t>(exec, boxes, n, is_hlbvh ? bvh::kHlbvhBits : 21);
  stage("codes");
  const uint64_t* codes = order.codes.data();
  const uint32_t* primitives = order.primitives.data();
  if (is_hlbvh) {
    bvh::hlbvh_merges(exec, codes, primitives, boxes, n, config.hlbvh_bits, merges, root);
  } else if (config.builder == DeviceBuilder::kHploc) {
    bvh::hploc_merges(exec, codes, primitives, boxes, n, config.ploc_radius, merges, root, sums);
  } else if (sums_while_building(config)) {
    bvh::radix_merges(exec, codes, primitives, boxes, n, merges, root, sums);
  } else {
    bvh::radix_merges(exec, codes, primitives, boxes, n, merges, root);
  }
  if (config.builder == DeviceBuilder::kAtrbvh && n > 2) {
    stage("radix tree");
    bvh::TreeletRounds<Exec> rounds(exec, bvh::TreeletInput{boxes, nullptr, n, merges}, root,
                                    bvh::LeafRule(config.cost, config.max_leaf_size));
    for (uint32_t i = 0; i < config.treelet_rounds; ++i) rounds.run_round(config.treelet_size);
  }
}

template <typename Exec, typename Stage>
void build_kmeans(Exec& exec, const DeviceBvhConfig& config, const Aabb* boxes, uint32_t n,
                  bvh::Merge* merges, bvh::Subtree* root, const Stage& stage) {
  exec.for_each(n, [=] UMBEL_DEVICE_LAMBDA(size_t i) { merges[i].count = 0; });
  bvh::KmeansPasses<Exec> passes(exec, boxes, n, config.kmeans, bvh::kFewForKmeans);
  passes.run([](double) {});
  stage("clusters");
  bvh::KmeansTreelets<Exec>(exec, passes, bvh::LeafRule(config.cost, config.max_leaf_size),
                            bvh::forwarded_clusters(config.kmeans), merges)
      .run(root);
}

template <typename Exec>
void build_sweep(Exec& exec, const Aabb* boxes, uint32_t n, bvh::Merge* merges,
                 bvh::Subtree* root) {
  auto count = exec.template allocate<uint32_t>(1);
  exec.for_each(1, [=, count = count.data()] UMBEL_DEVICE_LAMBDA(size_t) { *count = n; });
  bvh::sweep_merges(exec, {boxes, nullptr, nullptr, nullptr}, count.data(), n, merges, root);
}

template <typename Exec, typename Stage, typename Sums = bvh::NoMergeSums>
void build_merges(Exec& exec, const DeviceBvhConfig& config, const Aabb* boxes, uint32_t n,
                  const bvh::ClusterRanges& clusters, bvh::Merge* merges, bvh::Subtree* root,
                  const Stage& stage, const Sums& sums = {}) {
  if (config.builder == DeviceBuilder::kKmeans)
    build_kmeans(exec, config, boxes, n, merges, root, stage);
  else if (config.builder == DeviceBuilder::kSweep)
    build_sweep(exec, boxes, n, merges, root);
  else if (config.builder == DeviceBuilder::kPloc)
    bvh::Ploc<Exec>().run(exec, boxes, n, config.ploc_radius, merges, root);
  else
    build_by_codes(exec, config, boxes, n, clusters, merges, root, stage, sums);
  stage("tree");
}

/// What boxes are multiplied by.
struct BoxScale {
  float factor = 1;
  uint32_t is_needed = 0;
};

/// Brings coordinates of extreme size to about 1 by a power of two, so that areas neither overflow
/// nor vanish. What that rounds away costs quality alone: nodes get their boxes from triangles.
/// `scene` holds all boxes; *has_area says whether it has any area after that, and *is_scaled
/// whether boxes were changed.
template <typename Exec>
void bring_to_scale(Exec& exec, const Aabb* scene, Aabb* boxes, uint32_t n, uint32_t* has_area,
                    uint32_t* is_scaled) {
  auto scale = exec.template allocate<BoxScale>(1);
  exec.for_each(1, [=, scale = scale.data()] UMBEL_DEVICE_LAMBDA(size_t) {
    Aabb whole = *scene;
    float most = 0;
    for (const float x :
         {whole.min.x, whole.min.y, whole.min.z, whole.max.x, whole.max.y, whole.max.z})
      if (std::fabs(x) > most) most = std::fabs(x);
    BoxScale found;
    if (most != 0 && !(most >= 1e-6f && most <= 1e6f)) {
      const uint32_t exponent = std::bit_cast<uint32_t>(most) >> 23;  // of a normal number
      found = {exponent == 0     ? 0x1p126f
               : exponent == 254 ? 0x1p-126f * 0.5f
                                 : std::bit_cast<float>((254 - exponent) << 23),
               1};
      whole = {whole.min * found.factor, whole.max * found.factor};
    }
    *has_area = bvh::CompactSums::area(whole) > 0;
    *is_scaled = found.is_needed;
    *scale = found;
  });
  exec.for_each_of(&scale.data()->is_needed, 1, n,
                   [=, scale = scale.data()] UMBEL_DEVICE_LAMBDA(size_t i) {
                     boxes[i].min = boxes[i].min * scale->factor;
                     boxes[i].max = boxes[i].max * scale->factor;
                   });
}

/// The boxes that a tree is built over: of triangles, or of their parts.
template <typename Exec>
void make_boxes(Exec& exec, const MeshCorners& corners, uint32_t n, uint32_t references,
                Aabb* boxes, Aabb* parts, uint32_t* triangles, uint32_t* has_area,
                uint32_t* is_scaled) {
  auto scene = exec.template allocate<Aabb>(1);
  if (references > n) {
    bvh::presplit(exec, corners, n, references - n, parts, triangles);
    exec.reduce(
        references, Aabb{}, [=] UMBEL_DEVICE_LAMBDA(size_t i) { return boxes[i] = parts[i]; },
        cluster::UniteBoxes{}, scene.data());
  } else {
    exec.reduce(
        n, Aabb{},
        [=] UMBEL_DEVICE_LAMBDA(size_t i) {
          const TriangleCorners c = corners(static_cast<uint32_t>(i));
          const Aabb box = bvh::box_of_finite(c.a, c.b, c.c);
          return boxes[i] = is_empty(box) ? Aabb{{0, 0, 0}, {0, 0, 0}} : box;
        },
        cluster::UniteBoxes{}, scene.data());
  }
  bring_to_scale(exec, scene.data(), boxes, references, has_area, is_scaled);
}

/// Over n triangles with these names (none: by their indices), at most 2^28 references. With
/// clusters, `config` names a builder that starts from codes, without presplit.
template <typename Exec, typename Stage>
void build_compact(Exec& exec, const MeshCorners& corners, const uint32_t* names, uint32_t n,
                   const DeviceBvhConfig& config, const bvh::CompactArrays& out, const Stage& stage,
                   const bvh::ClusterRanges& clusters = {}) {
  const uint32_t references = device_references(n, config);
  if (n == 0) {
    exec.for_each(1, [out] UMBEL_DEVICE_LAMBDA(size_t) { *out.info = bvh::CompactInfo{}; });
    return;
  }
  const bool splits = references > n;
  auto order = exec.template allocate<uint32_t>(references);
  auto triangle_of = exec.template allocate<uint32_t>(splits ? references : 0);
  auto parts = exec.template allocate<Aabb>(splits ? references : 0);
  // Nodes, if their boxes are not those that the tree was built over; else 0.
  auto unfitted = exec.template allocate<uint32_t>(1);
  {
    auto boxes = exec.template allocate<Aabb>(references);
    auto merges = exec.template allocate<bvh::Merge>(references);
    auto root = exec.template allocate<bvh::Subtree>(1);
    auto has_area = exec.template allocate<uint32_t>(1);
    make_boxes(exec, corners, n, references, boxes.data(), parts.data(), triangle_of.data(),
               has_area.data(), unfitted.data());
    stage("boxes");
    const uint32_t merge_count =
        config.builder == DeviceBuilder::kKmeans ? references : references - 1;
    const bvh::BinaryTree tree{merges.data(), merge_count, root.data(), boxes.data(), references};
    const auto sums_in = [&](const bvh::CompactSumArrays<Exec>& arrays) {
      return arrays.sums(has_area.data(), config.cost, config.max_leaf_size);
    };
    const auto lay_out = [&](const bvh::CompactSums& sums) {
      bvh::lay_out_compact(exec, tree, sums, out.nodes, out.info, order.data(), unfitted.data());
    };
    if (sums_while_building(config)) {
      const bvh::CompactSumArrays<Exec> arrays(exec, merge_count);
      build_merges(exec, config, boxes.data(), references, clusters, merges.data(), root.data(),
                   stage, sums_in(arrays));
      lay_out(sums_in(arrays));
    } else {
      build_merges(exec, config, boxes.data(), references, clusters, merges.data(), root.data(),
                   stage);
      const bvh::CompactSumArrays<Exec> arrays(exec, merge_count);
      bvh::sum_up(exec, tree, sums_in(arrays));
      lay_out(sums_in(arrays));
    }
    stage("nodes");
  }
  auto ordered_parts = exec.template allocate<Aabb>(splits ? references : 0);
  exec.for_each(references, [=, order = order.data(), triangle_of = triangle_of.data(),
                             parts = parts.data(), ordered = ordered_parts.data(),
                             unfitted = unfitted.data()] UMBEL_DEVICE_LAMBDA(size_t i) {
    const uint32_t item = order[i], triangle = splits ? triangle_of[item] : item;
    const TriangleCorners c = corners(triangle);
    if (splits) ordered[i] = parts[item];
    // It was built over as a point, and has no box.
    if (!is_finite(c.a) || !is_finite(c.b) || !is_finite(c.c))
      atomic_max(unfitted, out.info->nodes);
    out.triangles[i] = {c.a, names ? names[triangle] : triangle, c.b, 0, c.c, 0};
  });
  bvh::refit_compact(exec, out, unfitted.data(), references,
                     splits ? ordered_parts.data() : nullptr);
  stage("triangles and their boxes");
}

/// New positions of the mesh that a tree was built over.
template <typename Exec>
void refit_triangles(Exec& exec, const MeshCorners& corners, uint32_t references,
                     const bvh::CompactArrays& tree) {
  exec.for_each(references, [=] UMBEL_DEVICE_LAMBDA(size_t i) {
    bvh::CompactTriangle& t = tree.triangles[i];
    const TriangleCorners c = corners(t.primitive);
    t.p0 = c.a;
    t.p1 = c.b;
    t.p2 = c.c;
  });
  bvh::refit_compact(exec, tree, &tree.info->nodes, references, nullptr);
}

}  // namespace umbel::cuda
