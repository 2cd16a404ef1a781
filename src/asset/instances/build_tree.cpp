#include "asset/instances/build_tree.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <string>

#include "asset/instances/bisect.hpp"
#include "asset/instances/stand_in.hpp"
#include "base/math.hpp"
#include "base/parallel.hpp"

namespace umbel::asset {
namespace {

constexpr uint32_t kMostChildren = 8;

/// What a node hands to its parent.
struct Built {
  std::vector<Member> stand_ins;
  Sphere sphere;
  double error = 0;
};

struct Ball {
  Vec3d center;
  double radius;
};

/// A sphere around spheres, with room for the rounding of tests in floats.
Sphere around(std::span<const Ball> balls) {
  constexpr double kRoom = 1 + 1e-4;
  Vec3d low = balls[0].center, high = low;
  for (const auto& [c, r] : balls) {
    low = {std::min(low.x, c.x - r), std::min(low.y, c.y - r), std::min(low.z, c.z - r)};
    high = {std::max(high.x, c.x + r), std::max(high.y, c.y + r), std::max(high.z, c.z + r)};
  }
  const Vec3d middle = 0.5 * (low + high);
  const Sphere made{
      {static_cast<float>(middle.x), static_cast<float>(middle.y), static_cast<float>(middle.z)},
      0};
  const Vec3d center{double{made.center.x}, double{made.center.y}, double{made.center.z}};
  double radius = 0;
  for (const auto& [c, r] : balls) radius = std::max(radius, length(c - center) + r);
  return {made.center, static_cast<float>(radius * kRoom)};
}

float rounded_up(double value) {
  return std::nextafter(static_cast<float>(value), std::numeric_limits<float>::max());
}

}  // namespace

struct InstanceTree::State {
 public:
  State(std::span<const Instance> instances, std::span<const InstancedMesh> meshes)
      : instances_(instances), meshes_(meshes), at_(instances.size()), order_(instances.size()) {
    for (const InstancedMesh& mesh : meshes) boxes_.push_back(mesh.bounds);
    std::iota(order_.begin(), order_.end(), 0u);
    parallel_chunks(instances.size(), 1 << 14, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) at_[i] = center_of(i);
    });
  }

  void build() {
    partition();
    inner_pages_.resize(plans_.size());
    nodes_.resize(plans_.size());
    const Built root = build(0);
    for (const Member& member : root.stand_ins) top_.push_back(member.instance);
    nodes_[0].stand_ins = {0, static_cast<uint32_t>(top_.size())};
  }

  const std::vector<InstanceNode>& nodes() const { return nodes_; }
  const std::vector<Instance>& top() const { return top_; }
  std::vector<Instance> placements(uint32_t n) const {
    const Plan& plan = plans_[n];
    if (plan.children.count > 0) return inner_pages_[n];
    std::vector<Instance> own;
    for (size_t i = plan.begin; i < plan.end; ++i) own.push_back(instances_[order_[i]]);
    return own;
  }

 private:
  struct Plan {
    size_t begin, end;
    Range children{0, 0};
  };

  std::span<uint32_t> items(const Plan& plan) {
    return std::span(order_).subspan(plan.begin, plan.end - plan.begin);
  }

  Vec3 center_of(size_t i) const {
    // Squares and sums of what is within it are finite floats.
    constexpr double kFarthest = 1e18;
    const PlacedBox box(boxes_[instances_[i].mesh], instances_[i].transform);
    const Vec3d& c = box.center();
    if (!(length(c) + box.radius() < kFarthest))
      throw Error(ErrorCode::kInvalidArgument,
                  "instance " + std::to_string(i) +
                      " reaches further than 1e18 from the origin, too far for a tree");
    return {static_cast<float>(c.x), static_cast<float>(c.y), static_cast<float>(c.z)};
  }

  /// Children that a node of so many instances has: leaves are full, or nearly.
  static uint32_t children_of(size_t count) {
    size_t in_child = kMostPlacements;
    while (in_child * kMostChildren < count) in_child *= kMostChildren;
    return static_cast<uint32_t>((count + in_child - 1) / in_child);
  }

  /// Level by level, so that nodes are numbered breadth first.
  void partition() {
    plans_.push_back({0, order_.size()});
    for (size_t begin = 0; begin < plans_.size();) {
      const size_t end = plans_.size();
      std::vector<std::vector<Range>> parts(end - begin);
      parallel_for(parts.size(), 1, [&](size_t k) {
        const Plan& plan = plans_[begin + k];
        const size_t count = plan.end - plan.begin;
        if (count > kMostPlacements) parts[k] = bisect(items(plan), children_of(count), at_);
      });
      for (size_t k = 0; k < parts.size(); ++k) {
        if (parts[k].empty()) continue;
        const size_t first = plans_[begin + k].begin;
        plans_[begin + k].children = {static_cast<uint32_t>(plans_.size()),
                                      static_cast<uint32_t>(parts[k].size())};
        for (const Range& part : parts[k])
          plans_.push_back({first + part.offset, first + part.offset + part.count});
      }
      begin = end;
    }
  }

  Built build(uint32_t n) {
    const Plan& plan = plans_[n];
    InstanceNode& node = nodes_[n];
    node.instances = static_cast<uint32_t>(plan.end - plan.begin);
    node.children = plan.children;
    std::vector<Ball> balls;
    Built built;
    if (plan.children.count == 0) {
      // Parts of a leaf are consecutive in its page.
      const std::span<uint32_t> own = items(plan);
      for (const Range& part : bisect(own, parts_of(own.size()), at_))
        std::sort(own.begin() + part.offset, own.begin() + part.offset + part.count);
      std::vector<Member> members;
      for (const uint32_t i : own)
        members.push_back(member_of(instances_[i], boxes_[instances_[i].mesh]));
      combine(n, members, balls, built);
    } else {
      std::vector<Built> children(plan.children.count);
      parallel_for(children.size(), 1, [&](size_t k) {
        children[k] = build(plan.children.offset + static_cast<uint32_t>(k));
      });
      std::vector<Member> members;
      for (uint32_t k = 0; k < children.size(); ++k) {
        const Built& child = children[k];
        nodes_[plan.children.offset + k].stand_ins = {
            static_cast<uint32_t>(members.size()), static_cast<uint32_t>(child.stand_ins.size())};
        members.insert(members.end(), child.stand_ins.begin(), child.stand_ins.end());
        const Vec3& c = child.sphere.center;
        balls.push_back({{double{c.x}, double{c.y}, double{c.z}}, double{child.sphere.radius}});
        built.error = std::max(built.error, child.error);
      }
      for (const Member& member : members) inner_pages_[n].push_back(member.instance);
      combine(n, members, balls, built);
    }
    node.sphere = built.sphere = around(balls);
    node.error = rounded_up(built.error);
    return built;
  }

  static uint32_t parts_of(size_t members) {
    return static_cast<uint32_t>((members + kMembers - 1) / kMembers);
  }

  double coarsest_error(const Instance& instance) const {
    return double{meshes_[instance.mesh].coarsest_error} * largest_scale(instance.transform);
  }

  /// Makes stand-ins of a page's placements.
  void combine(uint32_t n, std::span<const Member> members, std::vector<Ball>& balls,
               Built& built) {
    constexpr double kGolden = 0.6180339887498949;
    InstanceNode& node = nodes_[n];
    node.placements = static_cast<uint32_t>(members.size());
    double coarsest = 0;
    std::vector<Vec3> at;
    std::vector<uint32_t> order(members.size());
    std::iota(order.begin(), order.end(), 0u);
    for (const Member& member : members) {
      coarsest = std::max(coarsest, coarsest_error(member.instance));
      balls.push_back({member.box.center(), member.box.radius()});
      const Vec3d& m = member.mean;
      at.push_back({static_cast<float>(m.x), static_cast<float>(m.y), static_cast<float>(m.z)});
    }
    node.coarsest_error = rounded_up(coarsest);
    for (const Range& part : bisect(order, parts_of(members.size()), at)) {
      std::vector<Member> some;
      std::sort(order.begin() + part.offset, order.begin() + part.offset + part.count);
      for (uint32_t k = 0; k < part.count; ++k) some.push_back(members[order[part.offset + k]]);
      const double ordinal = static_cast<double>(built.stand_ins.size() + 1) + 64.0 * n;
      const double choice = ordinal * kGolden - std::floor(ordinal * kGolden);
      Member made = stand_in(some, boxes_, choice);
      const bool is_exact = some.size() == 1 && made.gap == 0;
      const double error = is_exact ? 0 : made.gap + made.thickness;
      built.error = std::max({built.error, error, coarsest_error(made.instance)});
      balls.push_back({made.box.center(), made.box.radius()});
      built.stand_ins.push_back(made);
    }
  }

  std::span<const Instance> instances_;
  std::span<const InstancedMesh> meshes_;
  std::vector<Aabb> boxes_;
  std::vector<Vec3> at_;
  std::vector<uint32_t> order_;
  std::vector<Plan> plans_;
  std::vector<std::vector<Instance>> inner_pages_;
  std::vector<InstanceNode> nodes_;
  std::vector<Instance> top_;
};

InstanceTree::InstanceTree(std::span<const Instance> instances,
                           std::span<const InstancedMesh> meshes)
    : state_(std::make_unique<State>(instances, meshes)) {
  state_->build();
}

InstanceTree::~InstanceTree() = default;

const std::vector<InstanceNode>& InstanceTree::nodes() const { return state_->nodes(); }
const std::vector<Instance>& InstanceTree::top() const { return state_->top(); }
std::vector<Instance> InstanceTree::placements(uint32_t node) const {
  return state_->placements(node);
}

}  // namespace umbel::asset
