// DynamicTree: numbers, checks, and trees from builders, around GrowingTree.
#include <algorithm>
#include <numeric>
#include <string>
#include <utility>

#include "bvh/build/growing_tree.hpp"
#include "bvh/tree/config.hpp"
#include "bvh/tree/node_area.hpp"
#include "umbel/bvh_traverse.hpp"

namespace umbel::bvh {
namespace {

/// As of Bvh::refit (docs/bvh.md).
constexpr double kRebuildRatio = 1.5;

void check_box(const Aabb& box) {
  if (is_finite(box.min) && is_finite(box.max) && !is_empty(box)) return;
  throw Error(ErrorCode::kInvalidMesh, "the box is empty, or has a NaN or infinite corner");
}

bool meet(const Aabb& a, const Aabb& b) {
  return a.min.x <= b.max.x && a.max.x >= b.min.x && a.min.y <= b.max.y && a.max.y >= b.min.y &&
         a.min.z <= b.max.z && a.max.z >= b.min.z;
}

/// A range of a leaf's primitives, which becomes a subtree.
struct Halving {
  uint32_t node, first, count;
};

}  // namespace

struct DynamicTree::Data {
  CostModel cost;
  GrowingTree tree{0};
  std::vector<uint8_t> is_used;  ///< by number
  std::vector<uint32_t> free_numbers;
  size_t size = 0;
  double built_sah_cost = 0;

  void check_number(uint32_t primitive) const {
    if (primitive < is_used.size() && is_used[primitive]) return;
    throw Error(ErrorCode::kInvalidArgument,
                "primitive " + std::to_string(primitive) + " is not in the tree");
  }
  const Aabb& box(uint32_t primitive) const { return tree.nodes()[tree.leaf_of(primitive)].box; }
  double sah_cost() const;
  void take(const Bvh2& built, std::span<const Aabb> boxes, std::span<const uint32_t> numbers);
};

double DynamicTree::Data::sah_cost() const {
  const auto nodes = tree.nodes();
  if (nodes.empty()) return 0;
  const double whole = half_area<Aabb>(nodes[0].box);
  double sum = 0;
  std::vector<uint32_t> stack{0};
  while (!stack.empty()) {
    const DynamicNode& node = nodes[stack.back()];
    stack.pop_back();
    const double area = whole > 0 ? half_area<Aabb>(node.box) : 1;
    sum += area * double(node.is_leaf() ? cost.intersection : cost.traversal);
    if (!node.is_leaf()) stack.insert(stack.end(), {node.first_child() + 1, node.first_child()});
  }
  return whole > 0 ? sum / whole : sum;
}

/// Makes this tree of a built one; primitive i of that has numbers[i].
void DynamicTree::Data::take(const Bvh2& built, std::span<const Aabb> boxes,
                             std::span<const uint32_t> numbers) {
  tree = GrowingTree(boxes.size());
  tree.track();
  if (built.nodes.empty()) {
    built_sah_cost = 0;
    return;
  }
  struct Target {
    uint32_t from, to;
  };
  const auto primitive_of = [&](uint32_t at) { return built.primitives[at]; };
  std::vector<Target> stack{{0, 0}};
  tree.set_root();
  std::vector<Halving> halvings;
  const auto put_leaf = [&](uint32_t at, uint32_t primitive) {
    tree.put(at, {boxes[primitive], Subtree::of_primitive(numbers[primitive]).link, 0});
  };
  while (!stack.empty()) {
    const auto [from, to] = stack.back();
    stack.pop_back();
    const Node& node = built.nodes[from];
    if (!node.is_leaf()) {
      const uint32_t left = 2 * tree.make_inner(to);
      stack.insert(stack.end(), {{node.first + 1, left + 1}, {node.first, left}});
      continue;
    }
    halvings.push_back({to, node.first, node.count});
    while (!halvings.empty()) {
      const Halving h = halvings.back();
      halvings.pop_back();
      if (h.count == 1) {
        put_leaf(h.node, primitive_of(h.first));
        continue;
      }
      const uint32_t left = 2 * tree.make_inner(h.node), half = h.count / 2;
      halvings.push_back({left + 1, h.first + half, h.count - half});
      halvings.push_back({left, h.first, half});
    }
  }
  tree.refit([&] {
    for (const uint32_t number : numbers) {
      const uint32_t leaf = tree.leaf_of(number);
      tree.set_box(leaf, tree.nodes()[leaf].box);
    }
  });
  built_sah_cost = sah_cost();
}

DynamicTree::DynamicTree(const CostModel& cost) : data_(std::make_unique<Data>()) {
  check_cost(cost);
  data_->cost = cost;
  data_->tree.track();
}
DynamicTree::~DynamicTree() = default;
// What was moved from stays a tree without primitives.
DynamicTree::DynamicTree(DynamicTree&& other) : DynamicTree() { data_.swap(other.data_); }
DynamicTree& DynamicTree::operator=(DynamicTree&& other) noexcept {
  data_.swap(other.data_);
  return *this;
}

DynamicTree DynamicTree::build(std::span<const Aabb> boxes, const Config& config,
                               const BuildOptions& options) {
  DynamicTree result(config.cost);
  const Bvh2 built = bvh::build(boxes, config, options);
  std::vector<uint32_t> numbers(boxes.size());
  std::iota(numbers.begin(), numbers.end(), 0u);
  result.data_->is_used.assign(boxes.size(), 1);
  result.data_->size = boxes.size();
  result.data_->take(built, boxes, numbers);
  return result;
}

uint32_t DynamicTree::insert(const Aabb& box) {
  check_box(box);
  Data& d = *data_;
  constexpr size_t kMost = size_t{1} << 30;
  if (d.free_numbers.empty()) {
    if (d.is_used.size() >= kMost)
      throw Error(ErrorCode::kUnsupported, "a tree of 2^30 primitives is full");
    d.free_numbers.reserve(1);
    d.is_used.push_back(0);
    d.free_numbers.push_back(static_cast<uint32_t>(d.is_used.size() - 1));
  }
  const uint32_t number = d.free_numbers.back();
  d.tree.insert(number, without_negative_zero(box));
  d.free_numbers.pop_back();
  d.is_used[number] = 1;
  ++d.size;
  return number;
}

void DynamicTree::remove(uint32_t primitive) {
  Data& d = *data_;
  d.check_number(primitive);
  d.free_numbers.push_back(primitive);
  try {
    d.tree.remove(d.tree.leaf_of(primitive));
  } catch (...) {
    d.free_numbers.pop_back();
    throw;
  }
  d.is_used[primitive] = 0;
  --d.size;
}

void DynamicTree::move(uint32_t primitive, const Aabb& box) {
  check_box(box);
  Data& d = *data_;
  d.check_number(primitive);
  const Aabb before = d.box(primitive);
  const uint32_t sibling = d.tree.remove(d.tree.leaf_of(primitive));
  try {
    d.tree.insert(primitive, without_negative_zero(box));
  } catch (...) {
    d.tree.insert_beside(sibling, primitive, before);
    throw;
  }
}

void DynamicTree::refit(std::span<const uint32_t> primitives, std::span<const Aabb> boxes) {
  Data& d = *data_;
  if (primitives.size() != boxes.size())
    throw Error(ErrorCode::kInvalidArgument, "there are " + std::to_string(primitives.size()) +
                                                 " primitives and " + std::to_string(boxes.size()) +
                                                 " boxes");
  for (const uint32_t primitive : primitives) d.check_number(primitive);
  for (const Aabb& box : boxes) check_box(box);
  if (boxes.empty()) return;
  d.tree.refit([&] {
    for (size_t i = 0; i < boxes.size(); ++i)
      d.tree.set_box(d.tree.leaf_of(primitives[i]), without_negative_zero(boxes[i]));
  });
}

void DynamicTree::rebuild(const Config& config, const BuildOptions& options) {
  Data& d = *data_;
  std::vector<uint32_t> numbers;
  std::vector<Aabb> boxes;
  for (uint32_t number = 0; number < d.is_used.size(); ++number) {
    if (!d.is_used[number]) continue;
    numbers.push_back(number);
    boxes.push_back(d.box(number));
  }
  Data made;
  made.cost = config.cost;
  made.take(bvh::build(boxes, config, options), boxes, numbers);
  made.is_used = std::move(d.is_used);
  made.free_numbers = std::move(d.free_numbers);
  made.size = d.size;
  d = std::move(made);
}

size_t DynamicTree::size() const { return data_->size; }

bool DynamicTree::contains(uint32_t primitive) const {
  return primitive < data_->is_used.size() && data_->is_used[primitive] != 0;
}

Aabb DynamicTree::box(uint32_t primitive) const {
  data_->check_number(primitive);
  return data_->box(primitive);
}

Aabb DynamicTree::bounds() const { return data_->tree.empty() ? Aabb{} : nodes()[0].box; }

DynamicQuality DynamicTree::quality() const {
  const double now = data_->sah_cost(), built = data_->built_sah_cost;
  return {now, built, built > 0 && now > kRebuildRatio * built};
}

std::vector<uint32_t> DynamicTree::overlaps(const Aabb& box) const {
  std::vector<uint32_t> found;
  if (is_empty(box)) return found;  // the tests below are for boxes with min <= max
  traverse(
      *this, [&](const Aabb& node) { return meet(node, box); },
      [&](uint32_t primitive) {
        found.push_back(primitive);
        return true;
      });
  std::sort(found.begin(), found.end());
  return found;
}

Bvh2 DynamicTree::snapshot(uint32_t max_leaf_size) const {
  if (max_leaf_size < 1 || max_leaf_size > 255)
    throw Error(ErrorCode::kInvalidArgument, "max_leaf_size is " + std::to_string(max_leaf_size) +
                                                 ", but must be from 1 to 255");
  Bvh2 result;
  const auto from = nodes();
  if (from.empty()) return result;
  struct Target {
    uint32_t from, to;
  };
  result.nodes.emplace_back();
  std::vector<Target> stack{{0, 0}};
  while (!stack.empty()) {
    const auto [source, to] = stack.back();
    stack.pop_back();
    const DynamicNode& node = from[source];
    if (node.is_leaf()) {
      const auto first = static_cast<uint32_t>(result.primitives.size());
      result.nodes[to] = {node.box.min, first, node.box.max, 1};
      result.primitives.push_back(node.primitive());
      continue;
    }
    const auto first = static_cast<uint32_t>(result.nodes.size());
    result.nodes[to] = {node.box.min, first, node.box.max, 0};
    result.nodes.resize(first + 2);
    const uint32_t left = node.first_child();
    stack.insert(stack.end(), {{left + 1, first + 1}, {left, first}});
  }
  limit_depth(result, kMaxTraversalDepth);
  collapse_leaves(result, data_->cost, max_leaf_size);
  return result;
}

std::span<const DynamicNode> DynamicTree::nodes() const { return data_->tree.nodes(); }

}  // namespace umbel::bvh
