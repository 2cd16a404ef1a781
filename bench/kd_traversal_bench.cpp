// What could be gained on the way through a kd-tree: other orders of its nodes in memory (treelets
// of a cache line, van Emde Boas), and mailboxes, which remember the triangles a ray was tested
// with. Timed is the traversal alone, with a touch of each leaf's first triangle, up to each ray's
// hit, by turns; counted is how many triangles, and packs of up to eight, a ray meets again.
//
//   kd_traversal_bench [--runs N] [--size PIXELS] MESH.ply...
#include <array>
#include <cstdio>
#include <cstdlib>
#include <string>

#include "clocks.hpp"
#include "kdtree/ray_traverse.hpp"
#include "mesh_reader.hpp"
#include "picture_rays.hpp"

namespace {

using namespace umbel;
using kdtree::Node;
using kdtree::Tree;

/// A tree whose siblings are neighbours: an inner node's link is the index of the child below, the
/// one above follows. So pairs can lie in any order, which depth-first nodes cannot.
struct Paired {
  std::vector<Node> nodes;
};

/// Orders of the pairs: each is the inner node, of the given tree, whose children they are.
using Order = std::vector<uint32_t>;

bool is_inner(const Tree& tree, uint32_t node) { return !tree.nodes[node].is_leaf(); }

Order depth_first(const Tree& tree) {
  Order order;
  for (uint32_t i = 0; i < tree.nodes.size(); ++i)
    if (is_inner(tree, i)) order.push_back(i);
  return order;
}

/// Greedily, breadth-first from each root, `pairs` to a treelet.
Order treelets(const Tree& tree, size_t pairs) {
  Order order;
  std::vector<uint32_t> roots;
  if (is_inner(tree, 0)) roots.push_back(0);
  while (!roots.empty()) {
    Order treelet{roots.back()};
    roots.pop_back();
    for (size_t next = 0; next < treelet.size(); ++next) {
      const uint32_t node = treelet[next];
      for (const uint32_t child : {node + 1, tree.nodes[node].above()}) {
        if (!is_inner(tree, child)) continue;
        if (treelet.size() < pairs)
          treelet.push_back(child);
        else
          roots.push_back(child);
      }
    }
    order.insert(order.end(), treelet.begin(), treelet.end());
  }
  return order;
}

/// The upper half of the levels first, then each subtree below it, and so in each of them.
class VanEmdeBoas {
 public:
  explicit VanEmdeBoas(const Tree& tree) : tree_(tree) {
    std::vector<uint32_t> below;
    if (is_inner(tree, 0)) lay_out(0, height(0), below);
  }
  Order order;

 private:
  uint32_t height(uint32_t node) const {
    if (!is_inner(tree_, node)) return 0;
    return 1 + std::max(height(node + 1), height(tree_.nodes[node].above()));
  }
  /// The inner nodes of `levels` levels from `node` on; `below` gets what is under them.
  void lay_out(uint32_t node, uint32_t levels, std::vector<uint32_t>& below) {
    if (levels == 1) {
      order.push_back(node);
      for (const uint32_t child : {node + 1, tree_.nodes[node].above()})
        if (is_inner(tree_, child)) below.push_back(child);
      return;
    }
    std::vector<uint32_t> middle;
    lay_out(node, levels / 2, middle);
    for (const uint32_t child : middle) lay_out(child, levels - levels / 2, below);
  }
  const Tree& tree_;
};

Paired paired(const Tree& tree, const Order& order) {
  std::vector<uint32_t> position(tree.nodes.size());
  for (uint32_t i = 0; i < order.size(); ++i) position[order[i]] = 2 * i + 1;
  const auto moved = [&](uint32_t node) {
    const Node& n = tree.nodes[node];
    return n.is_leaf() ? n : Node::inner(n.axis(), n.at, position[node]);
  };
  Paired result;
  result.nodes.resize(2 * order.size() + 1);
  result.nodes[0] = moved(0);
  for (uint32_t i = 0; i < order.size(); ++i) {
    result.nodes[2 * i + 1] = moved(order[i] + 1);
    result.nodes[2 * i + 2] = moved(tree.nodes[order[i]].above());
  }
  return result;
}

struct AsBuilt {
  const std::vector<Node>& nodes;
  uint32_t below(uint32_t node) const { return node + 1; }
  uint32_t above(uint32_t node) const { return nodes[node].above(); }
};
struct AsPairs {
  const std::vector<Node>& nodes;
  uint32_t below(uint32_t node) const { return nodes[node].above(); }
  uint32_t above(uint32_t node) const { return nodes[node].above() + 1; }
};

/// traverse_with_stack for any order of nodes.
template <typename Nodes, typename Leaf>
void traverse_nodes(const Nodes& tree, const RayFrame& f, const ClippedRay& part,
                    const Leaf& leaf) {
  CellEntry stack[kMaxKdDepth + 1];
  CellEntry* top = stack;
  const uint32_t flips[3] = {f.inv[0] < 0.0f, f.inv[1] < 0.0f, f.inv[2] < 0.0f};
  uint32_t node = 0;
  float from = part.from, to = part.to;
  while (true) {
    while (!tree.nodes[node].is_leaf()) {
      const uint32_t axis = tree.nodes[node].axis();
      const PlanePass pass = pass_of(f, axis, tree.nodes[node].at);
      const uint32_t below = tree.below(node), above = tree.above(node);
      const uint32_t first = flips[axis] ? above : below, second = flips[axis] ? below : above;
      if (pass.high < from) {
        node = second;
      } else if (pass.low > to) {
        node = first;
      } else {
        *top++ = {second, pass.low > from ? pass.low : from, to};
        if (pass.high < to) to = pass.high;
        node = first;
      }
    }
    leaf(tree.nodes[node]);
    if (top == stack) return;
    --top;
    node = top->node;
    from = top->from;
    to = top->to;
  }
}

struct Work {
  KdTreeData bounds;  ///< what frames and ClippedRays are made of
  std::vector<RayFrame> frames;
  std::vector<ClippedRay> parts;
};

/// The parts of the rays up to their hits.
Work work_of(const Tree& tree, const TriangleQueries& structure, const std::vector<Ray>& rays) {
  Work work;
  work.bounds.bounds = tree.bounds;
  prepare_scale(work.bounds);
  for (const Ray& ray : rays) {
    RayFrame frame;
    if (!make_frame(work.bounds, ray, frame)) continue;
    ClippedRay part;
    const float t = structure.intersect(ray).t / frame.t_unit;
    if (!clip_to_bounds(work.bounds, frame, t, part)) continue;
    work.frames.push_back(frame);
    work.parts.push_back(part);
  }
  return work;
}

/// Nanoseconds a ray.
template <typename Nodes>
double time_walk(const Nodes& nodes, const Work& work, const std::vector<uint32_t>& triangles,
                 uint64_t& sum) {
  const double start = bench::process_seconds();
  for (size_t i = 0; i < work.frames.size(); ++i)
    traverse_nodes(nodes, work.frames[i], work.parts[i], [&](const Node& leaf) {
      if (leaf.count() > 0) sum += triangles[size_t{10} * leaf.first];
    });
  return 1e9 * (bench::process_seconds() - start) / static_cast<double>(work.frames.size());
}

/// Nanoseconds a ray of whole queries.
double time_queries(const kdtree::KdTree& tree, const std::vector<Ray>& rays,
                    std::vector<Hit>& hits) {
  const double start = bench::process_seconds();
  tree.intersect(rays, hits, {}, 1);
  return 1e9 * (bench::process_seconds() - start) / static_cast<double>(rays.size());
}

/// Of a stack; those of ropes and of a short stack relative to it.
void print_queries(kdtree::KdTree& tree, const std::vector<Ray>& rays, size_t runs) {
  using kdtree::Traversal;
  std::vector<Hit> hits(rays.size());
  std::vector<double> times[3];
  for (size_t run = 0; run < runs; ++run)
    for (const Traversal way : {Traversal::kStack, Traversal::kRopes, Traversal::kShortStack}) {
      tree.set_traversal(way);
      times[static_cast<size_t>(way)].push_back(time_queries(tree, rays, hits));
    }
  const double stack = bench::median(times[0]);
  std::printf(" %.0f | %.3f | %.3f |", stack, bench::median(times[1]) / stack,
              bench::median(times[2]) / stack);
}

void print_counts(const Tree& tree, const Work& work) {
  double inner = 0, leaves = 0, tests = 0, again = 0, packs = 0, packs_again = 0, mailed = 0;
  std::vector<size_t> tested(tree.references.size(), SIZE_MAX);
  struct Counting {
    const std::vector<Node>& nodes;
    double& inner;
    uint32_t below(uint32_t node) const {
      ++inner;
      return node + 1;
    }
    uint32_t above(uint32_t node) const { return nodes[node].above(); }
  };
  for (size_t i = 0; i < work.frames.size(); ++i) {
    std::array<uint32_t, 8> mail;
    mail.fill(kNone);
    traverse_nodes(Counting{tree.nodes, inner}, work.frames[i], work.parts[i],
                   [&](const Node& leaf) {
                     ++leaves;
                     for (uint32_t first = 0; first < leaf.count(); first += 8) {
                       bool all = true;
                       ++packs;
                       uint32_t& letter = mail[(leaf.first + first) % mail.size()];
                       mailed += letter == leaf.first + first;
                       letter = leaf.first + first;
                       for (uint32_t k = first; k < std::min(first + 8, leaf.count()); ++k) {
                         size_t& last = tested[tree.references[leaf.first + k]];
                         ++tests;
                         again += last == i;
                         all = all && last == i;
                         last = i;
                       }
                       packs_again += all;
                     }
                   });
  }
  const auto n = static_cast<double>(work.frames.size());
  std::printf(" %.1f | %.1f | %.1f | %.3f | %.1f | %.3f | %.3f |\n", inner / n, leaves / n,
              tests / n, tests > 0 ? again / tests : 0, packs / n,
              packs > 0 ? packs_again / packs : 0, packs > 0 ? mailed / packs : 0);
}

void run_mesh(const std::string& path, size_t runs, uint32_t size) {
  const Mesh mesh = bench::read_mesh(path);
  const trace::Scene scene = trace::Scene::build(mesh.view());
  const std::vector<Ray> primary =
      bench::camera_rays(trace::auto_camera(scene, size, size), size, 1);
  const std::vector<Ray> bounce = bench::bounces(mesh, primary, scene.structure());
  const Tree tree = kdtree::build(mesh.view());
  kdtree::KdTree queries = kdtree::KdTree::of(tree, mesh.view());
  const std::vector<uint32_t> triangles(10 * tree.references.size() + 10);
  const Paired orders[] = {paired(tree, depth_first(tree)), paired(tree, treelets(tree, 4)),
                           paired(tree, treelets(tree, 256)),
                           paired(tree, VanEmdeBoas(tree).order)};
  for (const auto& [kind, rays] : {std::pair{"primary", &primary}, std::pair{"bounce", &bounce}}) {
    const Work work = work_of(tree, scene.structure(), *rays);
    std::vector<double> seconds[5];
    uint64_t sum = 0;
    for (size_t run = 0; run < runs; ++run) {
      seconds[0].push_back(time_walk(AsBuilt{tree.nodes}, work, triangles, sum));
      for (size_t i = 0; i < 4; ++i)
        seconds[i + 1].push_back(time_walk(AsPairs{orders[i].nodes}, work, triangles, sum));
    }
    const double as_built = bench::median(seconds[0]);
    std::printf("| %s | %s | %.0f |", path.substr(path.find_last_of('/') + 1).c_str(), kind,
                as_built + 0 * static_cast<double>(sum));
    for (size_t i = 1; i < 5; ++i) std::printf(" %.3f |", bench::median(seconds[i]) / as_built);
    print_queries(queries, *rays, runs);
    print_counts(tree, work);
    std::fflush(stdout);
  }
}

}  // namespace

int main(int argc, char** argv) {
  size_t runs = 7;
  uint32_t size = 256;
  std::vector<std::string> meshes;
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    const bool has_number = (word == "--runs" || word == "--size") && i + 1 < argc;
    if (!has_number) {
      meshes.push_back(word);
      continue;
    }
    const auto number = static_cast<uint32_t>(std::max(std::strtol(argv[++i], nullptr, 10), 1L));
    if (word == "--runs")
      runs = number;
    else
      size = std::max(number / 16, 1u) * 16;
  }
  std::printf(
      "Medians of %zu by turns. Times of other orders are relative to the nodes as they are built; "
      "pairs: siblings side by side.\n\n"
      "| mesh | rays | ns a ray | pairs | pairs, lines | pairs, pages | pairs, van Emde Boas |"
      " query, ns a ray | with ropes | with a short stack | inner nodes a ray | leaves | triangles "
      "| of them again | packs | of them again |"
      " in a mailbox of 8 |\n"
      "|---|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|\n",
      runs);
  for (const std::string& mesh : meshes) run_mesh(mesh, runs, size);
  return 0;
}
