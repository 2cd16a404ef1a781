// The bounding interval hierarchy (Waechter & Keller, "Instant Ray Tracing: The Bounding Interval
// Hierarchy", 2006). Space is halved across its longest axis, whatever lies in it, until triangles
// lie on both sides; they are told apart by their boxes' centres.
#include <algorithm>
#include <string>

#include "base/parallel.hpp"
#include "query/shape_kernels.hpp"
#include "uniform/build_over.hpp"
#include "uniform/interval_data.hpp"
#include "uniform/ray_kernels.hpp"

namespace umbel {
namespace {

IntervalNode leaf_node(uint32_t first, uint32_t count) {
  IntervalNode node;
  node.first = first;
  node.count = count;
  node.link = 3;
  return node;
}

class IntervalBuilder {
 public:
  IntervalBuilder(std::span<const Aabb> boxes, std::span<uint32_t> order, uint32_t max_leaf_size,
                  SharedProgress& progress)
      : boxes_(boxes), order_(order), max_leaf_size_(max_leaf_size), progress_(progress) {}

  /// The subtree of order[begin, end). Links are relative, so subtrees can be put together.
  void grow(uint32_t begin, uint32_t end, const Aabb& space, uint32_t depth,
            std::vector<IntervalNode>& out) const {
    const uint32_t count = end - begin;
    if (count <= max_leaf_size_) {
      std::sort(order_.begin() + begin, order_.begin() + end);
      out.push_back(leaf_node(begin, count));
      return;
    }
    Half half{space, 0, 0};
    const uint32_t middle = depth < kMaxHalvings && find_half(begin, end, half)
                                ? partition(begin, end, half)
                                : halve_by_number(begin, end, half);
    Aabb below = half.space, above = half.space;
    component(below.max, half.axis) = component(above.min, half.axis) = half.at;
    const size_t index = out.size();
    out.push_back(inner_node(begin, middle, end, half.axis));
    const auto link_above = [&] {
      out[index].link = static_cast<uint32_t>(out.size() - index) << 2 | half.axis;
    };
    if (count < kSequential) {
      grow(begin, middle, below, depth + 1, out);
      link_above();
      grow(middle, end, above, depth + 1, out);
      return;
    }
    std::vector<IntervalNode> first, second;
    const auto grow_part = [&](uint32_t from, uint32_t to, const Aabb& half_space,
                               std::vector<IntervalNode>& part) {
      grow(from, to, half_space, depth + 1, part);
      if (to - from < kSequential) progress_.add(to - from);
    };
    parallel_invoke([&] { grow_part(begin, middle, below, first); },
                    [&] { grow_part(middle, end, above, second); });
    out.insert(out.end(), first.begin(), first.end());
    link_above();
    out.insert(out.end(), second.begin(), second.end());
  }

 private:
  static constexpr uint32_t kSequential = 1u << 13;

  /// A part of space and the plane that halves it.
  struct Half {
    Aabb space;
    uint32_t axis;
    float at;
  };

  Vec3 centre(uint32_t i) const { return center(boxes_[order_[i]]); }

  /// False where centres cannot be told apart.
  bool find_half(uint32_t begin, uint32_t end, Half& half) const {
    Aabb centres;
    for (uint32_t i = begin; i < end; ++i) extend(centres, centre(i));
    if (centres.min == centres.max) return false;
    while (true) {
      half.axis = longest_axis(half.space);
      float &low = component(half.space.min, half.axis),
            &high = component(half.space.max, half.axis);
      half.at = low * 0.5f + high * 0.5f;
      if (!(half.at > low && half.at < high)) return false;
      if (component(centres.min, half.axis) >= half.at)
        low = half.at;
      else if (component(centres.max, half.axis) < half.at)
        high = half.at;
      else
        return true;
    }
  }

  static uint32_t longest_axis(const Aabb& box) {
    const Vec3 extent = box.max * 0.5f - box.min * 0.5f;
    if (extent.x >= extent.y && extent.x >= extent.z) return 0;
    return extent.y >= extent.z ? 1 : 2;
  }

  uint32_t partition(uint32_t begin, uint32_t end, const Half& half) const {
    const auto middle =
        std::stable_partition(order_.begin() + begin, order_.begin() + end, [&](uint32_t number) {
          const Vec3 c = center(boxes_[number]);
          return component(c, half.axis) < half.at;
        });
    return static_cast<uint32_t>(middle - order_.begin());
  }

  static uint32_t halve_by_number(uint32_t begin, uint32_t end, Half& half) {
    half.axis = longest_axis(half.space);
    half.at = component(half.space.max, half.axis);
    return begin + (end - begin) / 2;
  }

  IntervalNode inner_node(uint32_t begin, uint32_t middle, uint32_t end, uint32_t axis) const {
    IntervalNode node;
    node.below_max = std::numeric_limits<float>::lowest();
    node.above_min = std::numeric_limits<float>::max();
    for (uint32_t i = begin; i < middle; ++i)
      node.below_max = std::max(node.below_max, component(boxes_[order_[i]].max, axis));
    for (uint32_t i = middle; i < end; ++i)
      node.above_min = std::min(node.above_min, component(boxes_[order_[i]].min, axis));
    node.link = 0;
    return node;
  }

  std::span<const Aabb> boxes_;
  std::span<uint32_t> order_;
  uint32_t max_leaf_size_;
  SharedProgress& progress_;
};

void check_config(const uniform::IntervalConfig& config) {
  if (config.max_leaf_size < 1 || config.max_leaf_size > 64)
    throw Error(
        ErrorCode::kInvalidArgument,
        "max_leaf_size is " + std::to_string(config.max_leaf_size) + ", but must be from 1 to 64");
}

void build_intervals(const MeshView& mesh, const uniform::IntervalConfig& config,
                     std::span<const uint32_t> masks, IntervalData& data, Progress& progress) {
  std::vector<uint32_t> order =
      usable_triangles(mesh, config.invalid == bvh::InvalidTriangles::kDrop);
  if (order.size() > kMaxReferences)
    throw Error(ErrorCode::kUnsupported, std::to_string(order.size()) +
                                             " triangles are more than the " +
                                             std::to_string(kMaxReferences) + " supported");
  std::vector<Aabb> boxes(mesh.triangles.size());
  parallel_for(order.size(), 4096, [&](size_t i) {
    for (const Vec3& corner : corners_of(mesh, order[i])) extend(boxes[order[i]], corner);
  });
  for (const uint32_t triangle : order) extend(data.bounds, boxes[triangle]);
  std::vector<IntervalNode> nodes;
  SharedProgress shared = node_progress(progress, order.size());
  if (!order.empty())
    IntervalBuilder(boxes, order, config.max_leaf_size, shared)
        .grow(0, static_cast<uint32_t>(order.size()), data.bounds, 0, nodes);
  std::vector<Range> lists;
  for (const IntervalNode& node : nodes)
    if (node.is_leaf()) lists.push_back(node.list());
  data.compact = config.compact;
  data.nodes.assign(nodes.begin(), nodes.end());
  fill_store(lists, order, mesh, masks, data);
}

}  // namespace

uniform::Statistics measure(const IntervalData& data, const bvh::CostModel& cost) {
  uniform::Statistics s = sizes_of(data, data.nodes);
  if (data.nodes.empty()) return s;
  struct Visit {
    IntervalNodes::Link link;
    uint32_t depth;
  };
  const IntervalNodes nodes(data);
  const double whole = cell_area(data.bounds);
  std::vector<Visit> stack{{nodes.root(), 0}};
  while (!stack.empty()) {
    const Visit visit = stack.back();
    stack.pop_back();
    const double share = whole > 0 ? cell_area(visit.link.cell) / whole : 1;
    if (nodes.is_leaf(visit.link)) {
      ++s.leaves;
      s.max_depth = std::max(s.max_depth, visit.depth);
      s.leaf_visits += share;
      s.tests += share * data.nodes[visit.link.name].count;
      continue;
    }
    s.inner_visits += share;
    stack.push_back({nodes.above(visit.link), visit.depth + 1});
    stack.push_back({nodes.below(visit.link), visit.depth + 1});
  }
  s.sah_cost = double(cost.traversal) * s.inner_visits + double(cost.intersection) * s.tests;
  return s;
}

void prepare(IntervalData& data, Simd simd) {
  set_queries(data, simd, portable_interval_kernels(), avx2_interval_kernels(),
              &shape_kernels_of<IntervalNodes>);
}

namespace uniform {

IntervalHierarchy::IntervalHierarchy()
    : UniformStructure(store_without_triangles<IntervalData>()) {}

IntervalHierarchy IntervalHierarchy::build(const MeshView& mesh, const IntervalConfig& config,
                                           std::span<const uint32_t> masks,
                                           const BuildOptions& options) {
  check_config(config);
  IntervalHierarchy result;
  result.store_ = build_over<IntervalData>(mesh, config, masks, options, build_intervals);
  return result;
}

}  // namespace uniform
}  // namespace umbel
