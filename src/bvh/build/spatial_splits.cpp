// SAH with spatial splits (Stich, Friedrich and Dietrich, "Spatial Splits in Bounding Volume
// Hierarchies", 2009): where the boxes of the best object split overlap, a plane may split the
// triangles instead, each part with a box of its own. Both kinds of split are searched in bins;
// spatial bins hold exactly clipped parts (chopped binning). References that are better left whole
// stay whole (reference unsplitting).
//
// References live in one array. A node owns a stretch of it with some spare room, which bounds how
// often references are split below; what is left of it goes to the children by a fixed rule, so
// nothing depends on the order in which subtrees are built.
#include <bit>
#include <cmath>
#include <memory>
#include <vector>

#include "base/parallel.hpp"
#include "base/polled_stage.hpp"
#include "bvh/build/builders.hpp"
#include "bvh/build/split_search.hpp"
#include "bvh/build/tree_parts.hpp"
#include "bvh/tree/box_node.hpp"
#include "bvh/tree/config.hpp"
#include "bvh/tree/leaf_rule.hpp"

namespace umbel::bvh {
namespace {

/// References [begin, begin + count) of an array, which may become more until `limit`.
struct Stretch {
  uint32_t begin, count, limit, depth;
  uint32_t spare() const { return limit - begin - count; }
};

/// A subtree that one thread builds, or two such trees.
struct Branch {
  std::unique_ptr<Branch> left, right;
  TreePart part{};
  const uint32_t* primitives = nullptr;
  uint32_t primitive_count = 0;
};

class SpatialBuilder {
 public:
  SpatialBuilder(const MeshView& mesh, Boxes boxes, const Config& config)
      : mesh_(mesh),
        config_(config),
        rule_(config),
        count_(static_cast<uint32_t>(boxes.size())),
        capacity_(count_ + budget(boxes.size(), config.spatial_budget)),
        references_(capacity_),
        primitives_(capacity_) {
    parallel_for(count_, 4096, [&](size_t i) {
      references_[i] = tagged(Box4::from(boxes[i]), static_cast<uint32_t>(i));
    });
    Box4 root = Box4::empty();
    for (uint32_t i = 0; i < count_; ++i) root.extend(references_[i]);
    least_overlap_ = config.spatial_overlap * root.half_area(root.pad());
  }

  Bvh2 build() {
    Branch root;
    grow({0, count_, capacity_, 0}, root);
    std::vector<TopNode> top;
    std::vector<TreePart> parts;
    std::vector<uint32_t> primitives;
    flatten(root, top, parts, primitives);
    return join_parts(top, parts, std::move(primitives));
  }

 private:
  static constexpr uint32_t kSequential = 1u << 12;
  // Spatial splits are not searched where they gain next to nothing for the time: among few
  // references, which become one leaf of a wide tree anyway, and where the children overlap in less
  // than this part of the node.
  static constexpr uint32_t kWholeBelow = 8;
  static constexpr uint32_t kFew = 4;
  static constexpr float kWorthOverlap = 0.35f;

  static uint32_t budget(size_t count, float fraction) {
    return static_cast<uint32_t>(
        std::min(double(count) * double(fraction), double(kMaxPrimitives) - double(count)));
  }

  void grow(const Stretch& stretch, Branch& branch) {
    if (stretch.count <= kSequential) {
      grow_part(stretch, branch);
      return;
    }
    Stretch left, right;
    divide(stretch, left, right);
    branch.left = std::make_unique<Branch>();
    branch.right = std::make_unique<Branch>();
    parallel_invoke([&] { grow(left, *branch.left); }, [&] { grow(right, *branch.right); });
  }

  uint32_t flatten(const Branch& branch, std::vector<TopNode>& top, std::vector<TreePart>& parts,
                   std::vector<uint32_t>& primitives) {
    if (!branch.left) {
      std::transform(branch.primitives, branch.primitives + branch.primitive_count,
                     std::back_inserter(primitives), [](uint32_t tag) { return tag & ~kIsPart; });
      parts.push_back(branch.part);
      parts.back().leaf_base = static_cast<uint32_t>(primitives.size());
      return ~static_cast<uint32_t>(parts.size() - 1);
    }
    const auto id = static_cast<uint32_t>(top.size());
    top.emplace_back();
    const uint32_t left = flatten(*branch.left, top, parts, primitives);
    const uint32_t right = flatten(*branch.right, top, parts, primitives);
    top[id] = {left, right};
    return id;
  }

  /// A finished subtree; its primitives lie before those of the subtrees finished earlier.
  struct Grown {
    Node node;
    uint32_t pairs, primitives;
    uint32_t references;  ///< before parts of one triangle in a leaf became one
    float cost;
  };

  /// Where a subtree's nodes and primitives go, from the back.
  struct Output {
    Node* nodes_end;
    Node* next_node;
    uint32_t* primitives_end;
    uint32_t* next_primitive;
  };

  void grow_part(const Stretch& stretch, Branch& branch) {
    Node* end = PartStore::scratch_end(2 * size_t(stretch.limit - stretch.begin));
    uint32_t* primitives_end = primitives_.data() + stretch.limit;
    Output out{end, end, primitives_end, primitives_end};
    const Grown grown = grow_below(stretch, out);
    branch.part = {grown.node, grown.pairs, end, 0};
    // The references are needed no more.
    static_assert(sizeof(Node) == sizeof(Box4));
    if (2 * branch.part.pairs <= stretch.limit - stretch.begin)
      PartStore::keep_at(branch.part, reinterpret_cast<Node*>(references_.data() + stretch.begin));
    else
      store_.keep(branch.part);
    branch.primitives = out.next_primitive;
    branch.primitive_count = grown.primitives;
  }

  Grown grow_below(const Stretch& stretch, Output& out) {
    if (stretch.count <= kFew && stretch.depth + stretch.count <= config_.max_depth)
      return grow_few(references_.data() + stretch.begin, stretch.count, out);
    if (stretch.count == 1) return grow_one(references_[stretch.begin], out);
    Stretch left, right;
    divide(stretch, left, right);
    const Grown second = grow_below(right, out);
    left.limit = stretch.limit - second.references;
    const Grown first = grow_below(left, out);
    return join(first, second, out);
  }

  Grown grow_one(const Box4& reference, Output& out) const {
    *--out.next_primitive = tag_of_reference(reference);
    return make_leaf(reference, 1, 1, out);
  }

  /// All partitions are tried.
  Grown grow_few(Box4* references, uint32_t count, Output& out) const {
    if (count == 1) return grow_one(references[0], out);
    uint32_t left = 1;
    if (count > 2) {
      Box4 ordered[kFew];
      const uint32_t mask = best_of_few(references, count);
      left = static_cast<uint32_t>(std::popcount(mask));
      for (uint32_t i = 0, l = 0, r = left; i < count; ++i)
        ordered[mask >> i & 1 ? l++ : r++] = references[i];
      std::copy_n(ordered, count, references);
    }
    const Grown second = grow_few(references + left, count - left, out);
    const Grown first = grow_few(references, left, out);
    return join(first, second, out);
  }

  /// The mask of the references that go to the left.
  static uint32_t best_of_few(const Box4* references, uint32_t count) {
    float best = std::numeric_limits<float>::infinity();
    uint32_t best_mask = 1;
    Float4 pad = splat(0);
    for (uint32_t i = 0; i < count; ++i) {
      const Float4 own = references[i].pad();
      pad = own[0] > pad[0] ? own : pad;
    }
    for (uint32_t mask = 1; mask < 1u << (count - 1); ++mask) {
      Box4 side[2] = {Box4::empty(), Box4::empty()};
      for (uint32_t i = 0; i < count; ++i) side[mask >> i & 1u].extend(references[i]);
      const auto left = static_cast<uint32_t>(std::popcount(mask));
      const float cost =
          side[1].half_area(pad) * float(left) + side[0].half_area(pad) * float(count - left);
      if (cost < best) {
        best = cost;
        best_mask = mask;
      }
    }
    return best_mask;
  }

  Grown make_leaf(const Box4& box, uint32_t count, uint32_t references, const Output& out) const {
    // Counted from the end: see TreePart::leaf_base.
    const auto first = static_cast<uint32_t>(out.next_primitive - out.primitives_end);
    const Node node = node_of(box, first, count);
    return {node, 0, count, references, rule_.leaf_cost(node.box(), count)};
  }

  Grown join(const Grown& left, const Grown& right, Output& out) const {
    Box4 box = Box4::from(left.node.box());
    box.extend(Box4::from(right.node.box()));
    Node node = node_of(box, 0, 0);
    const float inner = rule_.inner_cost(node.box(), left.cost, right.cost);
    const uint32_t primitives = left.primitives + right.primitives;
    const uint32_t references = left.references + right.references;
    // Parts of one triangle count once in a leaf, so even more of them may fit.
    if (primitives <= 2 * rule_.max_leaf_size) {
      const uint32_t count = count_distinct(out.next_primitive, primitives);
      if (count <= rule_.max_leaf_size && rule_.leaf_cost(node.box(), count) <= inner) {
        out.next_node += 2 * (left.pairs + right.pairs);
        keep_distinct(out.next_primitive, primitives);
        out.next_primitive += primitives - count;
        return make_leaf(box, count, references, out);
      }
    }
    // NOLINTNEXTLINE(clang-analyzer-core.*): a store for two leaves and more is never empty
    *--out.next_node = right.node;
    *--out.next_node = left.node;
    node.first = static_cast<uint32_t>(out.nodes_end - out.next_node);
    return {node, left.pairs + right.pairs + 1, primitives, references, inner};
  }

  static uint32_t count_distinct(const uint32_t* tags, uint32_t count) {
    uint32_t any = 0, distinct = 0;
    for (uint32_t i = 0; i < count; ++i) any |= tags[i];
    if ((any & kIsPart) == 0) return count;
    for (uint32_t i = 0; i < count; ++i) distinct += std::find(tags, tags + i, tags[i]) == tags + i;
    return distinct;
  }

  /// The distinct values, at the end.
  static void keep_distinct(uint32_t* values, uint32_t count) {
    uint32_t* const end = values + count;
    uint32_t* kept = end;
    for (uint32_t* value = end; value-- != values;)
      if (std::find(kept, end, *value) == end) *--kept = *value;
  }

  /// Splits a stretch of at least two references into two that are not empty.
  void divide(const Stretch& stretch, Stretch& left, Stretch& right) {
    Box4* references = references_.data() + stretch.begin;
    const uint32_t n = stretch.count, levels = config_.max_depth - stretch.depth - 1;
    const NodeBounds bounds = bounds_of(references, n);
    Split split = best_partition(references, n, bounds);
    const bool roomy = stretch.spare() > 0 && fits_depth(size_t(n) + stretch.spare(), levels);
    const float worth = std::max(least_overlap_, kWorthOverlap * bounds.box.half_area(bounds.pad));
    if (roomy && n > kWholeBelow && split.overlap > worth) {
      const Split spatial = best_spatial_split(references, n, bounds, mesh_);
      if (spatial.cost < split.cost &&
          spatial.left_count + spatial.right_count <= n + stretch.spare())
        split = spatial;
    }
    Halves halves = split.is_spatial
                        ? split_references(references, n, stretch.spare(), split, mesh_)
                        : partition_references(references, n, split);
    if (!fits_depth(std::max(halves.left_count, halves.right_count), levels)) {
      // Only an object split comes here: before a spatial one there is room for every reference.
      std::copy(halves.right, halves.right + halves.right_count, references + halves.left_count);
      halves = {n / 2, n - n / 2, copy_to_scratch(references + n / 2, n - n / 2)};
    }
    divide_room(stretch, halves, left, right);
  }

  /// How much there is to gain by splitting: boxes with volume hold more than their triangles.
  /// Of many, some tell.
  static double waste(const Box4* references, uint32_t count) {
    constexpr uint32_t kSome = 1024;
    if (count <= kWholeBelow) return 0;
    const uint32_t step = (count + kSome - 1) / kSome;
    double sum = 0;
    uint32_t seen = 0;
    for (uint32_t i = 0; i < count; i += step, ++seen) {
      const Float4 e = references[i].extents();
      sum += double(std::sqrt(e[0] * e[1] * e[2]));
    }
    return sum * (double(count) / seen);
  }

  /// Divides the spare room and moves the right half to its own stretch.
  void divide_room(const Stretch& stretch, const Halves& halves, Stretch& left, Stretch& right) {
    const uint32_t spare = stretch.limit - stretch.begin - halves.left_count - halves.right_count;
    const bool any = spare > 0;
    const double left_weight =
        any ? waste(references_.data() + stretch.begin, halves.left_count) : 0;
    const double right_weight = any ? waste(halves.right, halves.right_count) : 0;
    const double share =
        left_weight + right_weight > 0 ? left_weight / (left_weight + right_weight) : 0.5;
    const uint32_t left_limit =
        stretch.begin + halves.left_count + static_cast<uint32_t>(double(spare) * share);
    left = {stretch.begin, halves.left_count, left_limit, stretch.depth + 1};
    right = {left_limit, halves.right_count, stretch.limit, stretch.depth + 1};
    std::copy(halves.right, halves.right + halves.right_count, references_.data() + left_limit);
  }

  const MeshView& mesh_;
  const Config& config_;
  const LeafRule rule_;
  const uint32_t count_;
  const uint32_t capacity_;
  CpuBuffer<Box4> references_;
  CpuBuffer<uint32_t> primitives_;
  PartStore store_;
  float least_overlap_ = 0;
};

}  // namespace

Bvh2 build_spatial(const MeshView& mesh, Boxes boxes, const Config& config,
                   BuildProgress& progress) {
  const PolledStage stage(progress, 0.1, "splitting in space");
  return SpatialBuilder(mesh, boxes, config).build();
}

}  // namespace umbel::bvh
