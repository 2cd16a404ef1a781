// A tree with up to k children a node, traced as it is: nodes with no more children than the width
// stay as they are; the children of others are agglomerated (Walter et al. 2008) until as many
// groups are left as the width.
#include "bvh/wide/widen_kary.hpp"

#include <algorithm>

#include "base/parallel.hpp"
#include "bvh/tree/config.hpp"
#include "bvh/tree/scale.hpp"
#include "bvh/tree/treelet_join.hpp"
#include "query/leaf_store.hpp"

namespace umbel {
namespace {

using bvh::KaryNode;
using bvh::KaryTree;
using Members = std::vector<uint32_t>;

/// Primitives below each node.
std::vector<uint32_t> weights_of(const KaryTree& tree) {
  std::vector<uint32_t> weights(tree.nodes.size());
  for (size_t i = tree.nodes.size(); i-- > 0;) {
    const KaryNode& node = tree.nodes[i];
    weights[i] = node.count;
    for (uint32_t k = 0; k < node.children; ++k) weights[i] += weights[node.first + k];
  }
  return weights;
}

/// Which nodes go together where there are more than the width.
class Groups {
 public:
  /// `even`: by numbers of primitives, which bounds the depth; else by boxes, which trace faster.
  Groups(const KaryTree& tree, uint32_t width, bool even)
      : tree_(tree),
        width_(width),
        even_(even),
        weights_(weights_of(tree)),
        scale_(bvh::moderate_scale(tree.nodes[0].box())) {}

  std::vector<Members> of(const Members& members) const {
    if (members.size() <= width_) {
      std::vector<Members> alone;
      for (const uint32_t member : members) alone.push_back({member});
      return alone;
    }
    return even_ ? by_weight(members) : by_box(members);
  }

 private:
  std::vector<Members> by_box(const Members& members) const {
    const auto count = static_cast<uint32_t>(members.size());
    std::vector<bvh::JoinItem> items(count);
    for (uint32_t i = 0; i < count; ++i) {
      const Aabb box = tree_.nodes[members[i]].box();
      items[i].box = bvh::scaled(box, scale_);
      items[i].count = weights_[members[i]];
    }
    std::vector<bvh::Join> joins(count);
    bvh::TreeletAgglomeration().run(items.data(), count, joins.data());
    std::vector<Members> groups(count);
    for (uint32_t i = 0; i < count; ++i) groups[i] = {members[i]};
    for (uint32_t made = 0; made < count - width_; ++made) {
      Members joined = std::move(groups[joins[made].left]);
      Members& right = groups[joins[made].right];
      joined.insert(joined.end(), right.begin(), right.end());
      right.clear();
      groups[joins[made].left].clear();
      groups.push_back(std::move(joined));
    }
    std::erase_if(groups, [](const Members& group) { return group.empty(); });
    return groups;
  }

  std::vector<Members> by_weight(const Members& members) const {
    uint64_t left = 0;
    for (const uint32_t member : members) left += weights_[member];
    std::vector<Members> groups;
    size_t next = 0;
    for (uint32_t rest = width_; rest > 0 && next < members.size(); --rest) {
      const uint64_t share = (left + rest - 1) / rest;
      uint64_t taken = 0;
      groups.emplace_back();
      do {
        taken += weights_[members[next]];
        groups.back().push_back(members[next++]);
      } while (next < members.size() && (rest == 1 || taken + weights_[members[next]] <= share));
      left -= taken;
    }
    return groups;
  }

  const KaryTree& tree_;
  uint32_t width_;
  bool even_;
  std::vector<uint32_t> weights_;
  float scale_;
};

/// Lays out nodes depth-first, and says which primitives each leaf holds.
class KaryEmitter {
 public:
  KaryEmitter(const KaryTree& tree, const Groups& groups, BvhData& out)
      : tree_(tree), groups_(groups), out_(out) {
    const KaryNode& root = tree.nodes[0];
    work_.push_back({root.is_leaf() ? Members{0} : children_of(root), 0, 0, {}, kNone, 0, 1});
    while (!work_.empty()) {
      const Work work = std::move(work_.back());
      work_.pop_back();
      emit(work);
    }
  }
  const std::vector<uint32_t>& order() const { return order_; }
  const std::vector<uint32_t>& leaves() const { return leaves_; }

 private:
  /// A node to be made: of nodes, or where `count` is not 0 of primitives of a leaf that is larger
  /// than a pack. Its children have the depth.
  struct Work {
    Members members;
    uint32_t first, count;
    Aabb box;
    uint32_t parent, slot;
    uint32_t depth;
  };

  static Members children_of(const KaryNode& node) {
    Members children(node.children);
    for (uint32_t k = 0; k < node.children; ++k) children[k] = node.first + k;
    return children;
  }

  void emit(const Work& work) {
    const uint32_t index = out_.node_count();
    out_.nodes.resize(out_.nodes.size() + out_.node_words());
    if (work.parent != kNone) out_.set_link(work.parent, work.slot, out_.node_link(index));
    for (uint32_t slot = 0; slot < out_.width; ++slot) out_.set_link(index, slot, kNoChild);
    if (work.count > 0)
      emit_run(work, index);
    else
      emit_groups(work, index);
  }

  void emit_groups(const Work& work, uint32_t index) {
    const std::vector<Members> groups = groups_.of(work.members);
    ChildBoxes boxes = kNoBoxes;
    // Backwards, so that the first child follows its parent in memory.
    for (auto slot = static_cast<uint32_t>(groups.size()); slot-- > 0;) {
      const Members& group = groups[slot];
      Aabb box;
      for (const uint32_t member : group) extend(box, tree_.nodes[member].box());
      boxes[slot] = box;
      const KaryNode& only = tree_.nodes[group[0]];
      if (group.size() > 1)
        work_.push_back({group, 0, 0, {}, index, slot, work.depth + 1});
      else if (!only.is_leaf())
        work_.push_back({children_of(only), 0, 0, {}, index, slot, work.depth + 1});
      else if (only.count > kMaxLeafTriangles)
        work_.push_back({{}, only.first, only.count, box, index, slot, work.depth + 1});
      else
        add_leaf(only.first, only.count, index, slot, work.depth);
    }
    out_.set_boxes(index, boxes.data());
  }

  void emit_run(const Work& work, uint32_t index) {
    ChildBoxes boxes = kNoBoxes;
    divide_run(work.count, out_.width,
               [&](uint32_t slot, uint32_t offset, uint32_t count, bool is_leaf) {
                 const uint32_t first = work.first + offset;
                 boxes[slot] = work.box;
                 if (!is_leaf)
                   work_.push_back({{}, first, count, work.box, index, slot, work.depth + 1});
                 else
                   add_leaf(first, count, index, slot, work.depth);
               });
    out_.set_boxes(index, boxes.data());
  }

  void add_leaf(uint32_t first, uint32_t count, uint32_t node, uint32_t slot, uint32_t depth) {
    const auto begin = static_cast<uint32_t>(order_.size());
    const auto from = tree_.primitives.begin() + first;
    order_.insert(order_.end(), from, from + count);
    std::sort(order_.begin() + begin, order_.end());
    leaves_.push_back(LeafStore::leaf_link(begin, count));
    out_.set_link(node, slot, leaves_.back());
    out_.max_depth = std::max(out_.max_depth, depth);
  }

  const KaryTree& tree_;
  const Groups& groups_;
  BvhData& out_;
  std::vector<Work> work_;
  std::vector<uint32_t> order_, leaves_;
};

BvhData widened(const KaryTree& tree, const MeshView& mesh, const WidenOptions& options,
                std::span<const uint32_t> masks, bool even) {
  BvhData out = empty_tree(mesh, options, masks);
  if (tree.nodes.empty()) return out;
  out.bounds = tree.nodes[0].box();
  const Groups groups(tree, options.width, even);
  const KaryEmitter emitter(tree, groups, out);
  check_size(out);
  const std::vector<uint32_t>& order = emitter.order();
  out.leaf_count = static_cast<uint32_t>(emitter.leaves().size());
  out.reference_count = static_cast<uint32_t>(order.size());
  std::vector<uint32_t> vertex_ids;
  if (options.compact) vertex_ids = collect_vertices(mesh, order, out.vertices);
  out.leaves.resize(size_t{out.reference_count} * out.reference_words() + kLeafPadding);
  parallel_for(emitter.leaves().size(), 1024, [&](size_t i) {
    fill_leaf(mesh, masks, vertex_ids, order, emitter.leaves()[i], out);
  });
  return out;
}

}  // namespace

BvhData widen_kary(const KaryTree& tree, const MeshView& mesh, const WidenOptions& options,
                   std::span<const uint32_t> masks) {
  BvhData out = widened(tree, mesh, options, masks, false);
  if (out.max_depth > bvh::kDeepest) out = widened(tree, mesh, options, masks, true);
  if (out.max_depth > bvh::kDeepest)
    throw Error(ErrorCode::kUnsupported, "a tree of " + std::to_string(out.max_depth) +
                                             " levels is deeper than the " +
                                             std::to_string(bvh::kDeepest) + " supported");
  return out;
}

}  // namespace umbel
