// Collapses a binary tree into one with up to 8 children a node, as widen_plan.hpp has chosen.
#include "bvh/wide/widen.hpp"

#include <algorithm>
#include <array>
#include <memory>
#include <string>

#include "base/parallel.hpp"
#include "bvh/wide/widen_plan.hpp"
#include "query/leaf_store.hpp"

namespace umbel {
namespace {

struct Leaf {
  uint32_t first, count;
};

/// A node to be made: of a binary node, or where `count` is not 0 of a run of primitives of a
/// binary leaf that is larger than a pack.
struct Work {
  uint32_t node, first, count;
  uint32_t parent, slot;
  uint32_t depth;
};

/// Lays out nodes depth-first, and says which primitives each leaf holds.
class Emitter {
 public:
  Emitter(const bvh::Bvh2& tree, const WidePlans& plans, BvhData& out)
      : tree_(tree), plans_(plans), out_(out) {}

  void reserve(size_t primitives) {
    order_.reserve(primitives);
    leaves_.reserve(primitives / 4 + 1);
  }

  /// Emits what is below; nodes of depth `end` are given to at_end instead, in their order.
  template <typename AtEnd>
  void run(const Work& root, uint32_t end, const AtEnd& at_end) {
    work_.push_back(root);
    while (!work_.empty()) {
      const Work work = work_.back();
      work_.pop_back();
      if (work.depth == end)
        at_end(work);
      else
        emit(work);
    }
  }

  /// Where the nodes, leaves and primitives of another emitter begin.
  struct Offsets {
    uint32_t node, leaf, primitive;
  };
  /// Makes room for what another emitter laid out.
  Offsets make_room(const Work& work, const Emitter& other) {
    const Offsets at{out_.node_count(), static_cast<uint32_t>(leaves_.size()),
                     static_cast<uint32_t>(order_.size())};
    out_.nodes.resize(out_.nodes.size() + other.out_.nodes.size());
    if (work.parent != kNone) out_.set_link(work.parent, work.slot, out_.node_link(at.node));
    out_.max_depth = std::max(out_.max_depth, other.out_.max_depth);
    leaves_.resize(leaves_.size() + other.leaves_.size());
    order_.resize(order_.size() + other.order_.size());
    return at;
  }
  /// Copies it there.
  void copy(const Emitter& other, const Offsets& at) {
    std::copy(other.out_.nodes.begin(), other.out_.nodes.end(), out_.node_at(at.node));
    for (uint32_t node = at.node; node < at.node + other.out_.node_count(); ++node)
      for (uint32_t slot = 0; slot < out_.width; ++slot) {
        const uint32_t link = out_.link(node, slot);
        if (link == kNoChild) continue;
        const uint32_t moved = LeafStore::is_leaf(link) ? at.primitive : out_.node_link(at.node);
        out_.set_link(node, slot, link + moved);
      }
    for (size_t i = 0; i < other.leaves_.size(); ++i)
      leaves_[at.leaf + i] = {other.leaves_[i].first + at.primitive, other.leaves_[i].count};
    std::copy(other.order_.begin(), other.order_.end(), order_.begin() + at.primitive);
  }

  const std::vector<uint32_t>& order() const { return order_; }
  const std::vector<Leaf>& leaves() const { return leaves_; }

 private:
  void emit(const Work& work) {
    const uint32_t index = add_node(work);
    if (work.count > 0)
      emit_run(work, index);
    else
      emit_children(work, index);
  }

  uint32_t add_node(const Work& work) {
    const uint32_t index = out_.node_count();
    if (out_.nodes.size() + out_.node_words() > out_.nodes.capacity())
      out_.nodes.reserve(2 * out_.nodes.capacity() + out_.node_words());
    out_.nodes.resize(out_.nodes.size() + out_.node_words());
    if (work.parent != kNone) out_.set_link(work.parent, work.slot, out_.node_link(index));
    for (uint32_t slot = 0; slot < out_.width; ++slot) out_.set_link(index, slot, kNoChild);
    return index;
  }

  void emit_children(const Work& work, uint32_t index) {
    children_.clear();
    const bvh::Node& node = tree_.nodes[work.node];
    const WidePlan& plan = plans_[work.node];
    if (plan.is_leaf) {
      children_.push_back(work.node);
    } else {
      collect(node.first, plan.left_share[0]);
      collect(node.first + 1, out_.width - plan.left_share[0]);
    }
    ChildBoxes boxes = kNoBoxes;
    for (uint32_t slot = 0; slot < children_.size(); ++slot) {
      const uint32_t child = children_[slot];
      const bvh::Node& c = tree_.nodes[child];
      boxes[slot] = c.box();
      if (!plans_[child].is_leaf) continue;
      if (plans_[child].primitives == kTooMany)
        work_.push_back({child, c.first, c.count, index, slot, work.depth + 1});
      else
        add_leaf_of(child, index, slot, work.depth + 1);
    }
    out_.set_boxes(index, boxes.data());
    // Backwards, so that the first child follows its parent in memory.
    for (auto slot = static_cast<uint32_t>(children_.size()); slot-- > 0;)
      if (!plans_[children_[slot]].is_leaf)
        work_.push_back({children_[slot], 0, 0, index, slot, work.depth + 1});
  }

  void collect(uint32_t node, uint32_t children) {
    const WidePlan& plan = plans_[node];
    while (children > 1 && plan.left_share[children - 1] == 0) --children;
    if (children == 1) {
      children_.push_back(node);
      return;
    }
    const uint32_t share = plan.left_share[children - 1];
    collect(tree_.nodes[node].first, share);
    collect(tree_.nodes[node].first + 1, children - share);
  }

  void emit_run(const Work& work, uint32_t index) {
    const Aabb box = tree_.nodes[work.node].box();
    ChildBoxes boxes = kNoBoxes;
    divide_run(work.count, out_.width,
               [&](uint32_t slot, uint32_t offset, uint32_t count, bool is_leaf) {
                 const uint32_t first = work.first + offset;
                 boxes[slot] = box;
                 if (!is_leaf) {
                   work_.push_back({work.node, first, count, index, slot, work.depth + 1});
                   return;
                 }
                 append(first, count);
                 add_leaf(count, index, slot, work.depth + 1);
               });
    out_.set_boxes(index, boxes.data());
  }

  void add_leaf_of(uint32_t node, uint32_t parent, uint32_t slot, uint32_t depth) {
    const size_t before = order_.size();
    gather(node);
    const auto count = static_cast<uint32_t>(order_.size() - before);
    add_leaf(count, parent, slot, depth);
  }

  /// At most kMaxLeafTriangles primitives, so the recursion is shallow.
  void gather(uint32_t index) {
    const bvh::Node& node = tree_.nodes[index];
    if (node.is_leaf()) return append(node.first, node.count);
    gather(node.first);
    gather(node.first + 1);
  }

  /// Few at a time, for which a call to move them would cost too much.
  void append(uint32_t first, uint32_t count) {
    for (uint32_t i = first; i < first + count; ++i) order_.push_back(tree_.primitives[i]);
  }

  /// A leaf of the primitives that were appended last.
  void add_leaf(uint32_t count, uint32_t parent, uint32_t slot, uint32_t depth) {
    const auto begin = order_.end() - count;
    std::sort(begin, order_.end());
    order_.erase(std::unique(begin, order_.end()), order_.end());
    const auto first = static_cast<uint32_t>(begin - order_.begin());
    const auto kept = static_cast<uint32_t>(order_.end() - begin);
    leaves_.push_back({first, kept});
    out_.set_link(parent, slot, LeafStore::leaf_link(first, kept));
    out_.max_depth = std::max(out_.max_depth, depth);
  }

  const bvh::Bvh2& tree_;
  const WidePlans& plans_;
  BvhData& out_;
  std::vector<Work> work_;
  std::vector<uint32_t> children_, order_;
  std::vector<Leaf> leaves_;
};

/// Emits all, subtrees below a few levels by all threads; the result does not depend on them.
void emit_all(const bvh::Bvh2& tree, const WidePlans& plans, BvhData& out, Emitter& emitter) {
  constexpr uint32_t kSharedLevels = 3, kNever = kNone;
  constexpr Work kRoot{0, 0, 0, kNone, 0, 0};
  const auto ignore = [](const Work&) {};
  if (usable_threads() == 1) {
    out.nodes.reserve(size_t{out.node_words()} * (tree.primitives.size() / 8 + 1));
    emitter.reserve(tree.primitives.size());
    emitter.run(kRoot, kNever, ignore);
    return;
  }
  const auto empty = [&] {
    auto data = std::make_unique<BvhData>();
    data->width = out.width;
    data->compact = data->quantised = out.quantised;
    return data;
  };
  std::vector<Work> roots;
  const auto top = empty();
  Emitter(tree, plans, *top).run(kRoot, kSharedLevels, [&](const Work& root) {
    roots.push_back(root);
  });
  struct Part {
    std::unique_ptr<BvhData> data;
    std::unique_ptr<Emitter> emitter;
    Emitter::Offsets at;
  };
  std::vector<Part> parts(roots.size());
  parallel_for(roots.size(), 1, [&](size_t i) {
    parts[i].data = empty();
    parts[i].emitter = std::make_unique<Emitter>(tree, plans, *parts[i].data);
    Work root = roots[i];
    root.parent = kNone;
    parts[i].emitter->run(root, kNever, ignore);
  });
  size_t words = top->nodes.size();
  for (const Part& part : parts) words += part.data->nodes.size();
  out.nodes.reserve(words);
  size_t next = 0;
  emitter.run(kRoot, kSharedLevels, [&](const Work& root) {
    Part& part = parts[next++];
    part.at = emitter.make_room(root, *part.emitter);
  });
  parallel_for(parts.size(), 1, [&](size_t i) { emitter.copy(*parts[i].emitter, parts[i].at); });
}

bool has_repeats(std::span<const uint32_t> order, size_t triangles) {
  std::vector<bool> seen(triangles);
  for (const uint32_t primitive : order) {
    if (seen[primitive]) return true;
    seen[primitive] = true;
  }
  return false;
}

}  // namespace

void check_triangles(const MeshView& mesh, std::span<const uint32_t> order) {
  for (const uint32_t primitive : order)
    for (const uint32_t vertex : mesh.triangles[primitive]) {
      if (vertex >= mesh.positions.size())
        throw Error(ErrorCode::kInvalidMesh,
                    "triangle " + std::to_string(primitive) + " has vertex index " +
                        std::to_string(vertex) + ", but there are " +
                        std::to_string(mesh.positions.size()) + " vertices");
      if (!is_finite(mesh.positions[vertex]))
        throw Error(ErrorCode::kInvalidMesh, "triangle " + std::to_string(primitive) +
                                                 ": the position of vertex " +
                                                 std::to_string(vertex) + " is not finite");
    }
}

void check_size(const BvhData& data) {
  if (data.nodes.size() > kMaxNodeWords)
    throw Error(ErrorCode::kUnsupported,
                "a tree of " + std::to_string(data.nodes.size() / data.node_words()) +
                    " nodes is larger than the " +
                    std::to_string(kMaxNodeWords / data.node_words()) + " supported");
}

BvhData empty_tree(const MeshView& mesh, const WidenOptions& options,
                   std::span<const uint32_t> masks) {
  BvhData out;
  out.width = options.width;
  out.compact = out.quantised = options.compact;
  out.masked = std::any_of(masks.begin(), masks.end(), [](uint32_t m) { return m != ~0u; });
  out.triangle_count = static_cast<uint32_t>(mesh.triangles.size());
  return out;
}

BvhData widen_tree(const bvh::Bvh2& tree, const MeshView& mesh, const WidenOptions& options,
                   std::span<const uint32_t> masks) {
  BvhData out = empty_tree(mesh, options, masks);
  if (tree.nodes.empty()) return out;
  if (tree.primitives.size() > kMaxReferences)
    throw Error(ErrorCode::kUnsupported, "a tree of " + std::to_string(tree.primitives.size()) +
                                             " references is larger than the " +
                                             std::to_string(kMaxReferences) + " supported");
  out.bounds = tree.nodes[0].box();

  const WidePlans plans(tree, options.width);
  Emitter emitter(tree, plans, out);
  emit_all(tree, plans, out, emitter);
  check_size(out);
  const std::vector<uint32_t>& order = emitter.order();
  if (!options.is_valid) check_triangles(mesh, order);
  out.leaf_count = static_cast<uint32_t>(emitter.leaves().size());
  out.reference_count = static_cast<uint32_t>(order.size());
  out.repeats = options.may_repeat && has_repeats(order, mesh.triangles.size()) ? 1 : 0;

  std::vector<uint32_t> vertex_ids;
  if (options.compact) vertex_ids = collect_vertices(mesh, order, out.vertices);
  out.leaves.resize(size_t{out.reference_count} * out.reference_words() + kLeafPadding);
  parallel_for(emitter.leaves().size(), 1024, [&](size_t i) {
    const Leaf& leaf = emitter.leaves()[i];
    fill_leaf(mesh, masks, vertex_ids, order, LeafStore::leaf_link(leaf.first, leaf.count), out);
  });
  return out;
}

}  // namespace umbel
