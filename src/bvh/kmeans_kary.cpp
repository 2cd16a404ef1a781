// The tree of k-means clusters itself, with up to k children a node, which Meister & Bittner name
// as future work.
#include <algorithm>
#include <cmath>
#include <string>

#include "base/parallel.hpp"
#include "base/progress.hpp"
#include "bvh/config.hpp"
#include "bvh/kmeans_recursion.hpp"

namespace umbel::bvh {
namespace {

/// Keeps nodes with children before their parents; they are turned around at the end.
class KaryMaker {
 public:
  using Result = KaryNode;

  explicit KaryMaker(uint32_t* primitives) : primitives_(primitives) {}

  KaryMaker for_task() const { return KaryMaker(primitives_); }

  Result leaf(const KmeansItem* items, uint32_t offset, uint32_t count) {
    Aabb box;
    for (uint32_t i = 0; i < count; ++i) {
      extend(box, Aabb{items[i].min, items[i].max});
      primitives_[offset + i] = items[i].primitive;
    }
    std::sort(primitives_ + offset, primitives_ + offset + count);
    return {box.min, offset, box.max, 0, static_cast<uint16_t>(count)};
  }

  Result inner(std::span<const Result> parts, uint32_t /*offset*/) {
    Aabb box;
    for (const Result& part : parts) extend(box, part.box());
    const auto first = static_cast<uint32_t>(nodes_.size());
    nodes_.insert(nodes_.end(), parts.begin(), parts.end());
    return {box.min, first, box.max, static_cast<uint16_t>(parts.size()), 0};
  }

  /// Appends the nodes of a task, and gives its result in their new numbers.
  Result adopt(const KaryMaker& of_task, Result result) {
    const auto shift = static_cast<uint32_t>(nodes_.size());
    for (KaryNode node : of_task.nodes_) {
      if (!node.is_leaf()) node.first += shift;
      nodes_.push_back(node);
    }
    if (!result.is_leaf()) result.first += shift;
    return result;
  }

  std::vector<KaryNode> finish(const Result& root) {
    nodes_.push_back(root);
    std::reverse(nodes_.begin(), nodes_.end());
    const auto size = static_cast<uint32_t>(nodes_.size());
    for (KaryNode& node : nodes_)
      if (!node.is_leaf()) node.first = size - node.first - node.children;
    return std::move(nodes_);
  }

 private:
  uint32_t* primitives_;
  std::vector<KaryNode> nodes_;
};

void check_boxes(Boxes boxes) {
  if (boxes.size() > kMaxPrimitives)
    throw Error(ErrorCode::kInvalidArgument,
                std::to_string(boxes.size()) + " boxes are more than a tree can hold");
  for (size_t i = 0; i < boxes.size(); ++i) {
    const bool finite = is_finite(boxes[i].min) && is_finite(boxes[i].max);
    if (finite && !is_empty(boxes[i])) continue;
    throw Error(ErrorCode::kInvalidMesh,
                "box " + std::to_string(i) + (finite ? " is empty" : " is not finite"));
  }
}

/// Copies of the boxes at a scale at which squares of distances neither overflow nor vanish.
std::vector<Aabb> scaled(Boxes boxes) {
  float largest = 0;
  for (const Aabb& b : boxes)
    for (const float v : {b.min.x, b.min.y, b.min.z, b.max.x, b.max.y, b.max.z})
      largest = std::max(largest, std::fabs(v));
  const int exponent = largest > 0 ? std::clamp(-std::ilogb(largest), -126, 126) : 0;
  const float scale = std::ldexp(1.0f, exponent);
  std::vector<Aabb> copies(boxes.begin(), boxes.end());
  for (Aabb& b : copies) b = {b.min * scale, b.max * scale};
  return copies;
}

/// Boxes at the input's own scale, which is not exactly the scaled one where that underflows.
void set_boxes(KaryTree& tree, Boxes boxes) {
  for (size_t i = tree.nodes.size(); i-- > 0;) {
    KaryNode& node = tree.nodes[i];
    Aabb box;
    for (uint32_t k = 0; k < node.count; ++k) extend(box, boxes[tree.primitives[node.first + k]]);
    for (uint32_t k = 0; k < node.children; ++k) extend(box, tree.nodes[node.first + k].box());
    node.min = box.min;
    node.max = box.max;
  }
}

}  // namespace

KaryTree build_kmeans_kary(std::span<const Aabb> boxes, const Config& config,
                           const BuildOptions& options) {
  check_config(config, boxes.size());
  check_boxes(boxes);
  KaryTree tree;
  if (boxes.empty()) return tree;
  Progress progress(options);
  tree.primitives.resize(boxes.size());
  with_threads(options.threads, [&] {
    const std::vector<Aabb> copies = scaled(boxes);
    KmeansRecursion<KaryMaker> recursion(copies, config.kmeans, config.max_leaf_size);
    KaryMaker maker(tree.primitives.data());
    const KaryNode root = recursion.run(maker, progress);
    tree.nodes = maker.finish(root);
    set_boxes(tree, boxes);
  });
  progress.report(1, "clustering");
  return tree;
}

}  // namespace umbel::bvh
