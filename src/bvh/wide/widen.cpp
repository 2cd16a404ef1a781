// Collapses a binary tree into one with up to 8 children a node, at the least expected cost over
// all ways to do so, by dynamic programming (Ylitie, Karras & Laine 2017); leaves are packs of at
// most 8 triangles, which cost little more than one, so subtrees become leaves where that is
// cheaper than to walk them.
#include "bvh/wide/widen.hpp"

#include <tbb/task_arena.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <limits>
#include <memory>
#include <string>

#include "base/parallel.hpp"
#include "base/simd/box4.hpp"
#include "query/leaf_store.hpp"

namespace umbel {
namespace {

// What a visit costs, in any unit: of a node, of a leaf, and of each triangle of it. Measured with
// ray_bench (see docs/bvh.md).
constexpr float kNodeCost = 1.0f, kLeafCost = 0.5f, kTriangleCost = 0.06f;

using bvh::Float4;
using bvh::Int4;

/// A subtree of more primitives than fit a leaf; how many more does not matter.
constexpr uint8_t kTooMany = kMaxLeafTriangles + 1;

/// What a binary node's subtree costs as at most 1 to 4 and 5 to 8 children.
struct Costs {
  Float4 few, many;
};

/// Costs of one child more each; `first` is the new first one.
Costs shifted(const Costs& costs, Float4 first) {
  return {__builtin_shufflevector(first, costs.few, 0, 4, 5, 6),
          __builtin_shufflevector(costs.few, costs.many, 3, 4, 5, 6)};
}

/// How many of 1 to 4 and 5 to 8 children go to the left.
struct ShareLanes {
  Int4 few, many;
};

using Shares = std::array<uint8_t, kMaxWidth>;

/// For one binary node: how best to make 1, 2, ... width children of its subtree.
struct Plan {
  /// [i - 1]: how many of i go to the left; 0: as for i - 1. [0]: how many of the node's own width.
  Shares left_share;
  uint8_t primitives;  ///< below, at most kTooMany
  uint8_t parts;       ///< binary leaves below, at most kMaxWidth: more children make no sense
  bool is_leaf;        ///< one child of it is a leaf
};

float leaf_cost(float area, uint32_t primitives) {
  // Larger leaves than a pack become nodes of packs.
  const uint32_t packs = (primitives + kMaxLeafTriangles - 1) / kMaxLeafTriangles;
  return area * ((packs > 1 ? kNodeCost : 0.0f) + kLeafCost * static_cast<float>(packs) +
                 kTriangleCost * static_cast<float>(primitives));
}

class Planner {
 public:
  Planner(const bvh::Bvh2& tree, uint32_t width)
      : tree_(tree),
        width_(width),
        plans_(std::make_unique_for_overwrite<Plan[]>(tree.nodes.size())) {
    plan(0, 0);
  }
  const Plan& operator[](uint32_t node) const { return plans_[node]; }

 private:
  /// Subtrees below are planned by one thread.
  static constexpr uint32_t kSharedLevels = 8;
  static constexpr float kNever = std::numeric_limits<float>::infinity();

  /// As deep as the tree, whose depth is bounded.
  Costs plan(uint32_t index, uint32_t depth) {
    const bvh::Node& node = tree_.nodes[index];
    Plan& p = plans_[index];
    const float area = half_area(node.box());
    if (node.is_leaf()) {
      p = {{}, static_cast<uint8_t>(std::min<uint32_t>(node.count, kTooMany)), 1, true};
      const Float4 cost = bvh::splat(leaf_cost(area, node.count));
      return {cost, cost};
    }
    Costs left, right;
    const auto plan_left = [&] { left = plan(node.first, depth + 1); };
    const auto plan_right = [&] { right = plan(node.first + 1, depth + 1); };
    if (depth < kSharedLevels) {
      tbb::parallel_invoke(plan_left, plan_right);
    } else {
      plan_left();
      plan_right();
    }
    const Plan &on_left = plans_[node.first], &on_right = plans_[node.first + 1];
    p.primitives = static_cast<uint8_t>(
        std::min<uint32_t>(on_left.primitives + on_right.primitives, kTooMany));
    p.parts = static_cast<uint8_t>(std::min<uint32_t>(on_left.parts + on_right.parts, kMaxWidth));
    ShareLanes shares;
    const Costs apart = distribute(left, right, on_left.parts, on_right.parts, shares);
    // One child: a node of its own, or a leaf.
    std::array<float, kMaxWidth> numbers;
    std::memcpy(numbers.data(), &apart, sizeof numbers);
    float one = numbers[width_ - 1] + area * kNodeCost;
    const uint8_t own_share = bytes_of(shares)[width_ - 1];
    p.is_leaf = false;
    if (p.primitives <= kMaxLeafTriangles) {
      const float as_leaf = leaf_cost(area, p.primitives);
      p.is_leaf = as_leaf <= one;
      one = std::min(one, as_leaf);
    }
    // As more children never cost more than fewer, but for one, only that is to be compared.
    const Float4 as_one = bvh::splat(one);
    const Costs costs{__builtin_shufflevector(as_one, bvh::min4(apart.few, as_one), 0, 5, 6, 7),
                      bvh::min4(apart.many, as_one)};
    const Costs before = shifted(costs, as_one);
    shares.few &= Int4(apart.few < before.few);
    shares.many &= Int4(apart.many < before.many);
    p.left_share = bytes_of(shares);
    p.left_share[0] = own_share;
    return costs;
  }

  /// What two children and more cost, and how many of them best go to the left.
  static Costs distribute(const Costs& left, const Costs& right, uint32_t left_parts,
                          uint32_t right_parts, ShareLanes& shares) {
    const Float4 never = bvh::splat(kNever);
    const Int4 one{1, 1, 1, 1};
    shares = ShareLanes{one, one};
    // A binary leaf is one child whatever room there is, and the other side takes what is left.
    if (left_parts == 1 || right_parts == 1) {
      if (left_parts > 1) shares = ShareLanes{Int4{0, 1, 2, 3}, Int4{4, 5, 6, 7}};
      const Costs rest = shifted(left_parts > 1 ? left : right, never);
      const Float4 leaf = left_parts > 1 ? right.few : left.few;
      return {rest.few + leaf, rest.many + leaf};
    }
    // All numbers of children at once, and for each number that go to the left in turn.
    std::array<float, kMaxWidth> lefts;
    std::memcpy(lefts.data(), &left, sizeof lefts);
    Costs best{never, never}, rest = right;
    const uint32_t most = std::min(left_parts, kMaxWidth - 1);
    for (uint32_t k = 1; k <= most; ++k) {
      rest = shifted(rest, never);
      const Float4 own = bvh::splat(lefts[k - 1]);
      take(own + rest.few, k, best.few, shares.few);
      take(own + rest.many, k, best.many, shares.many);
    }
    return best;
  }

  static void take(Float4 cost, uint32_t share, Float4& best, Int4& shares) {
    const Int4 is_better = Int4(cost < best);
    best = bvh::min4(cost, best);
    const auto number = static_cast<int>(share);
    shares = (Int4{number, number, number, number} & is_better) | (shares & ~is_better);
  }

  static Shares bytes_of(const ShareLanes& shares) {
    Shares bytes;
#if defined(__SSE2__)
    const __m128i words = _mm_packs_epi32(__m128i(shares.few), __m128i(shares.many));
    const __m128i packed = _mm_packus_epi16(words, words);
    std::memcpy(bytes.data(), &packed, sizeof bytes);
#else
    for (int i = 0; i < 4; ++i) {
      bytes[i] = static_cast<uint8_t>(shares.few[i]);
      bytes[i + 4] = static_cast<uint8_t>(shares.many[i]);
    }
#endif
    return bytes;
  }

  const bvh::Bvh2& tree_;
  uint32_t width_;
  std::unique_ptr<Plan[]> plans_;
};

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
  Emitter(const bvh::Bvh2& tree, const Planner& plans, BvhData& out)
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
  struct Place {
    uint32_t node, leaf, primitive;
  };
  /// Makes room for what another emitter laid out.
  Place make_room(const Work& work, const Emitter& other) {
    const Place place{out_.node_count(), static_cast<uint32_t>(leaves_.size()),
                      static_cast<uint32_t>(order_.size())};
    out_.nodes.resize(out_.nodes.size() + other.out_.nodes.size());
    if (work.parent != kNone) out_.set_link(work.parent, work.slot, out_.node_link(place.node));
    out_.max_depth = std::max(out_.max_depth, other.out_.max_depth);
    leaves_.resize(leaves_.size() + other.leaves_.size());
    order_.resize(order_.size() + other.order_.size());
    return place;
  }
  /// Moves it there.
  void copy(const Emitter& other, const Place& place) {
    std::copy(other.out_.nodes.begin(), other.out_.nodes.end(), out_.node_at(place.node));
    for (uint32_t node = place.node; node < place.node + other.out_.node_count(); ++node)
      for (uint32_t slot = 0; slot < out_.width; ++slot) {
        const uint32_t link = out_.link(node, slot);
        if (link == kNoChild) continue;
        const uint32_t moved =
            LeafStore::is_leaf(link) ? place.primitive : out_.node_link(place.node);
        out_.set_link(node, slot, link + moved);
      }
    for (size_t i = 0; i < other.leaves_.size(); ++i)
      leaves_[place.leaf + i] = {other.leaves_[i].first + place.primitive, other.leaves_[i].count};
    std::copy(other.order_.begin(), other.order_.end(), order_.begin() + place.primitive);
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
    const Plan& plan = plans_[work.node];
    if (plan.is_leaf) {
      children_.push_back(work.node);
    } else {
      collect(node.first, plan.left_share[0]);
      collect(node.first + 1, out_.width - plan.left_share[0]);
    }
    SlotBoxes boxes = kNoBoxes;
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
    const Plan& plan = plans_[node];
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
    SlotBoxes boxes = kNoBoxes;
    uint32_t part = kMaxLeafTriangles;
    while (uint64_t{part} * out_.width < work.count) part *= out_.width;
    for (uint32_t slot = 0; slot * part < work.count; ++slot) {
      const uint32_t first = work.first + slot * part;
      const uint32_t count = std::min(part, work.count - slot * part);
      boxes[slot] = box;
      if (part > kMaxLeafTriangles) {
        work_.push_back({work.node, first, count, index, slot, work.depth + 1});
        continue;
      }
      append(first, count);
      add_leaf(count, index, slot, work.depth + 1);
    }
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

  /// Few at a time, for which a call to move them would be dear.
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
  const Planner& plans_;
  BvhData& out_;
  std::vector<Work> work_;
  std::vector<uint32_t> children_, order_;
  std::vector<Leaf> leaves_;
};

/// Emits all, subtrees below a few levels by all threads; the result does not depend on them.
void emit_all(const bvh::Bvh2& tree, const Planner& plans, BvhData& out, Emitter& emitter) {
  constexpr uint32_t kSharedLevels = 3, kNever = kNone;
  constexpr Work kRoot{0, 0, 0, kNone, 0, 0};
  const auto ignore = [](const Work&) {};
  if (tbb::this_task_arena::max_concurrency() == 1) {
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
    Emitter::Place place;
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
    part.place = emitter.make_room(root, *part.emitter);
  });
  parallel_for(parts.size(), 1, [&](size_t i) { emitter.copy(*parts[i].emitter, parts[i].place); });
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

BvhData widen_tree(const bvh::Bvh2& tree, const MeshView& mesh, const WidenOptions& options,
                   std::span<const uint32_t> masks) {
  BvhData out;
  out.width = options.width;
  out.compact = out.quantised = options.compact;
  out.masked = std::any_of(masks.begin(), masks.end(), [](uint32_t m) { return m != ~0u; });
  out.triangle_count = static_cast<uint32_t>(mesh.triangles.size());
  if (tree.nodes.empty()) return out;
  if (tree.primitives.size() > kMaxReferences)
    throw Error(ErrorCode::kUnsupported, "a tree of " + std::to_string(tree.primitives.size()) +
                                             " references is larger than the " +
                                             std::to_string(kMaxReferences) + " supported");
  out.bounds = tree.nodes[0].box();

  const Planner plans(tree, options.width);
  Emitter emitter(tree, plans, out);
  emit_all(tree, plans, out, emitter);
  check_size(out);
  const std::vector<uint32_t>& order = emitter.order();
  if (!options.is_valid) check_triangles(mesh, order);
  out.leaf_count = static_cast<uint32_t>(emitter.leaves().size());
  out.reference_count = static_cast<uint32_t>(order.size());
  out.repeats = options.may_repeat && has_repeats(order, mesh.triangles.size()) ? 1 : 0;

  std::vector<uint32_t> places;
  if (options.compact) places = collect_vertices(mesh, order, out.vertices);
  out.leaves.resize(size_t{out.reference_count} * out.reference_words() + kLeafPadding);
  parallel_for(emitter.leaves().size(), 1024, [&](size_t i) {
    const Leaf& leaf = emitter.leaves()[i];
    fill_leaf(mesh, masks, places, order, LeafStore::leaf_link(leaf.first, leaf.count), out);
  });
  return out;
}

}  // namespace umbel
