// Octrees (Glassner, "Space Subdivision for Fast Ray Tracing", 1984): a cube is cut at its middle
// across all axes, and so are those of its parts in which more than a few triangles lie. Nothing
// depends on the number of threads.
#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <string>

#include "base/parallel.hpp"
#include "base/printed.hpp"
#include "query/shape_kernels.hpp"
#include "uniform/build_over.hpp"
#include "uniform/octree_data.hpp"
#include "uniform/ray_kernels.hpp"
#include "uniform/touched_cells.hpp"

namespace umbel {
namespace {

/// Nodes with their references, both numbered from 0; node 0 is the root.
struct Subtree {
  std::vector<OctreeNode> nodes;
  std::vector<uint32_t> references;
};

class OctreeBuilder {
 public:
  /// What the whole tree counts for in the progress.
  static constexpr uint64_t kWork = uint64_t{1} << 40;

  OctreeBuilder(const MeshView& mesh, uint32_t max_leaf_size, uint32_t max_depth,
                SharedProgress& progress)
      : mesh_(mesh), max_leaf_size_(max_leaf_size), max_depth_(max_depth), progress_(progress) {}

  /// The subtree of a cell that these triangles touch. `spare` is how many references more there
  /// may be, `work` what the subtree counts for in the progress.
  Subtree grow(std::vector<uint32_t> triangles, const Aabb& cell, uint32_t depth, uint64_t spare,
               uint64_t work) const {
    Subtree part;
    part.nodes.emplace_back();
    const bool is_small = triangles.size() < kSequential;
    grow(std::move(triangles), cell, depth, spare, is_small ? 0 : work, 0, part);
    if (is_small) progress_.add(work);
    return part;
  }

 private:
  static constexpr size_t kSequential = 1u << 12;
  using Lists = std::array<std::vector<uint32_t>, 8>;

  void grow(std::vector<uint32_t> triangles, const Aabb& cell, uint32_t depth, uint64_t spare,
            uint64_t work, uint32_t node, Subtree& out) const {
    const size_t count = triangles.size();
    Lists lists;
    const Vec3 middle = center(cell);
    if (count <= max_leaf_size_ || depth == max_depth_ || !is_within(middle, cell) ||
        !divide(triangles, cell, middle, spare, lists)) {
      out.nodes[node] = OctreeNode::leaf(
          {static_cast<uint32_t>(out.references.size()), static_cast<uint32_t>(count)});
      out.references.insert(out.references.end(), triangles.begin(), triangles.end());
      return;
    }
    std::vector<uint32_t>().swap(triangles);
    size_t total = 0;
    for (const auto& list : lists) total += list.size();
    spare -= total > count ? total - count : 0;
    const auto share = [&](uint64_t of, uint32_t child) {
      return static_cast<uint64_t>(double(of) * double(lists[child].size()) / double(total));
    };
    const auto children = static_cast<uint32_t>(out.nodes.size());
    out.nodes[node] = OctreeNode::inner(middle, children);
    out.nodes.resize(out.nodes.size() + 8);
    std::array<uint64_t, 8> spares, works;
    for (uint32_t child = 0; child < 8; ++child) {
      spares[child] = share(spare, child);
      works[child] = share(work, child);
    }
    if (count < kSequential) {
      for (uint32_t child = 0; child < 8; ++child)
        grow(std::move(lists[child]), child_cell(cell, middle, child), depth + 1, spares[child], 0,
             children + child, out);
      return;
    }
    std::array<Subtree, 8> parts;
    parallel_for(8, 1, [&](size_t i) {
      const auto child = static_cast<uint32_t>(i);
      parts[child] = grow(std::move(lists[child]), child_cell(cell, middle, child), depth + 1,
                          spares[child], works[child]);
    });
    for (uint32_t child = 0; child < 8; ++child) append(parts[child], children + child, out);
  }

  static bool is_within(const Vec3& middle, const Aabb& cell) {
    return middle.x > cell.min.x && middle.x < cell.max.x && middle.y > cell.min.y &&
           middle.y < cell.max.y && middle.z > cell.min.z && middle.z < cell.max.z;
  }

  static Aabb child_cell(const Aabb& cell, const Vec3& middle, uint32_t child) {
    Aabb result = cell;
    for (uint32_t axis = 0; axis < 3; ++axis)
      component(child >> axis & 1 ? result.min : result.max, axis) = component(middle, axis);
    return result;
  }

  /// Lists what touches each child; false if that is too much, or if nothing is told apart.
  bool divide(std::span<const uint32_t> triangles, const Aabb& cell, const Vec3& middle,
              uint64_t spare, Lists& lists) const {
    std::array<Aabb, 8> cells;
    for (uint32_t child = 0; child < 8; ++child) cells[child] = child_cell(cell, middle, child);
    std::vector<uint8_t> touched(triangles.size());
    parallel_for(triangles.size(), 1024,
                 [&](size_t i) { touched[i] = touched_children(triangles[i], cells); });
    size_t total = 0, most = 0;
    std::array<size_t, 8> counts{};
    for (const uint8_t bits : touched)
      for (uint32_t child = 0; child < 8; ++child) counts[child] += bits >> child & 1;
    for (const size_t count : counts) total += count, most = std::max(most, count);
    const size_t used =
        size_t(std::count_if(counts.begin(), counts.end(), [](size_t c) { return c > 0; }));
    // All triangles in every child that has any: they share a point, and will go on to.
    if (used > 1 && total == used * triangles.size()) return false;
    if (total > triangles.size() + spare) return false;
    for (uint32_t child = 0; child < 8; ++child) {
      lists[child].reserve(counts[child]);
      for (size_t i = 0; i < triangles.size(); ++i)
        if (touched[i] >> child & 1) lists[child].push_back(triangles[i]);
    }
    return true;
  }

  uint8_t touched_children(uint32_t triangle, const std::array<Aabb, 8>& cells) const {
    const TriangleCorners corners = corners_of(mesh_, triangle);
    Aabb box;
    for (const Vec3& corner : corners) extend(box, corner);
    const CellTest test(corners);
    uint8_t bits = 0;
    for (uint32_t child = 0; child < 8; ++child)
      if (overlap::meet(box, cells[child]) && test.touches(cells[child])) bits |= 1u << child;
    return bits;
  }

  /// Puts the root of a part into its place, and what lies below behind all that there is.
  static void append(const Subtree& part, uint32_t place, Subtree& out) {
    const auto nodes = static_cast<uint32_t>(out.nodes.size()) - 1;
    const auto references = static_cast<uint32_t>(out.references.size());
    for (size_t i = 0; i < part.nodes.size(); ++i) {
      OctreeNode node = part.nodes[i];
      if (node.is_leaf())
        node.list.offset += references;
      else
        node.children += nodes;
      if (i == 0)
        out.nodes[place] = node;
      else
        out.nodes.push_back(node);
    }
    out.references.insert(out.references.end(), part.references.begin(), part.references.end());
  }

  const MeshView& mesh_;
  uint32_t max_leaf_size_, max_depth_;
  SharedProgress& progress_;
};

/// With its lowest corner at that of the bounds, so that a flat scene is not cut along its plane.
Aabb cube_around(const Aabb& bounds) {
  double side = 0;
  for (uint32_t axis = 0; axis < 3; ++axis)
    side =
        std::max(side, double(component(bounds.max, axis)) - double(component(bounds.min, axis)));
  Aabb cube = bounds;
  for (uint32_t axis = 0; axis < 3; ++axis) {
    const double high = double(component(bounds.min, axis)) + side;
    const auto limit = double(std::numeric_limits<float>::max());
    float& max = component(cube.max, axis);
    max = std::max(max, static_cast<float>(std::min(high, limit)));
  }
  return cube;
}

/// Surfaces fill some 4^depth cells, and meshes are denser in some places than in others.
uint32_t depth_limit(uint32_t max_depth, size_t count) {
  if (max_depth > 0) return max_depth;
  return std::min(kMaxOctreeDepth, static_cast<uint32_t>(6 + 0.5 * std::log2(double(count) + 1)));
}

void build_octree(const MeshView& mesh, const uniform::OctreeConfig& config,
                  std::span<const uint32_t> masks, OctreeData& data, Progress& progress) {
  const std::vector<uint32_t> triangles =
      usable_triangles(mesh, config.invalid == bvh::InvalidTriangles::kDrop);
  const size_t count = triangles.size();
  if (count > kMaxReferences)
    throw Error(ErrorCode::kUnsupported, std::to_string(count) + " triangles are more than the " +
                                             std::to_string(kMaxReferences) + " supported");
  Subtree part;
  data.compact = config.compact;
  if (count > 0) {
    for (const uint32_t triangle : triangles)
      for (const Vec3& corner : corners_of(mesh, triangle)) extend(data.bounds, corner);
    const double spare = double(count) * (double(config.max_references) - 1);
    SharedProgress shared = node_progress(progress, OctreeBuilder::kWork);
    part = OctreeBuilder(mesh, config.max_leaf_size, depth_limit(config.max_depth, count), shared)
               .grow(triangles, cube_around(data.bounds), 0,
                     std::min(static_cast<uint64_t>(spare), uint64_t{kMaxReferences} - count),
                     OctreeBuilder::kWork);
  }
  std::vector<Range> lists;
  for (const OctreeNode& node : part.nodes)
    if (node.is_leaf()) lists.push_back(node.list);
  std::sort(lists.begin(), lists.end(),
            [](const Range& a, const Range& b) { return a.offset < b.offset; });
  data.nodes.assign(part.nodes.begin(), part.nodes.end());
  fill_store(lists, part.references, mesh, masks, data);
}

void check_config(const uniform::OctreeConfig& c) {
  const auto check = [](const char* name, double value, uint32_t low, uint32_t high) {
    if (!(value >= low && value <= high))
      throw Error(ErrorCode::kInvalidArgument, std::string(name) + " is " + printed(value) +
                                                   ", but must be from " + std::to_string(low) +
                                                   " to " + std::to_string(high));
  };
  check("max_leaf_size", c.max_leaf_size, 1, 64);
  check("max_depth", c.max_depth, 0, kMaxOctreeDepth);
  check("max_references", double(c.max_references), 1, 64);
}

}  // namespace

uniform::Statistics measure(const OctreeData& data, const bvh::CostModel& cost) {
  uniform::Statistics s = sizes_of(data, data.nodes);
  if (data.nodes.empty()) return s;
  const double whole = cell_area(data.bounds);
  const OctreeNodes nodes(data);
  struct Visit {
    OctreeNodes::Link link;
    uint32_t depth;
  };
  std::vector<Visit> stack{{nodes.root(), 0}};
  while (!stack.empty()) {
    const auto [link, depth] = stack.back();
    stack.pop_back();
    const double area = is_empty(link.cell) ? 0 : cell_area(link.cell);
    const double share = whole > 0 ? area / whole : 1;
    if (nodes.is_leaf(link)) {
      const uint32_t count = data.nodes[link.name.node].list.count;
      ++s.leaves;
      s.empty_leaves += count == 0;
      s.max_depth = std::max(s.max_depth, depth);
      s.leaf_visits += share;
      s.tests += share * count;
      continue;
    }
    // Each plane is a step.
    s.inner_visits += share;
    const uint32_t below = depth + (link.name.axes == 2 ? 1 : 0);
    stack.push_back({nodes.above(link), below});
    stack.push_back({nodes.below(link), below});
  }
  s.sah_cost = double(cost.traversal) * s.inner_visits + double(cost.intersection) * s.tests;
  return s;
}

void prepare(OctreeData& data, Simd simd) {
  set_queries(data, simd, portable_octree_kernels(), avx2_octree_kernels(),
              &shape_kernels_of<OctreeNodes>);
}

namespace uniform {

Octree::Octree() : UniformStructure(store_without_triangles<OctreeData>()) {}

Octree Octree::build(const MeshView& mesh, const OctreeConfig& config,
                     std::span<const uint32_t> masks, const BuildOptions& options) {
  check_config(config);
  Octree result;
  result.store_ = build_over<OctreeData>(mesh, config, masks, options, build_octree);
  return result;
}

}  // namespace uniform
}  // namespace umbel
