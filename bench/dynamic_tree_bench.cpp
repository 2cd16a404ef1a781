// bvh::DynamicTree over the boxes of a mesh's triangles: what removals, insertions, moves and
// refits cost, and what they leave of the tree.
//
//   dynamic_tree_bench [--runs N] MESH.ply...
//
// One thread, processor time, medians of runs. The boxes of half of the triangles, in random order,
// are taken out and put in again. Another tree is only inserted, in the mesh's order, and one in
// random order. Then a tenth of the boxes moves in ten steps, each of 1 % of the mesh's diagonal in
// a random direction, by move() or by one refit() a step. Queries are boxes of a 50th of the
// diagonal around random triangles; also asked is a snapshot, the same tree with its nodes in
// order.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <numeric>
#include <random>
#include <string>
#include <vector>

#include "arguments.hpp"
#include "base/math.hpp"
#include "clocks.hpp"
#include "mesh_reader.hpp"
#include "umbel/bvh_traverse.hpp"
#include "umbel/dynamic_bvh.hpp"
#include "umbel/mesh.hpp"

namespace {

using namespace umbel;
using bench::median;
using bench::thread_seconds;
using bvh::DynamicTree;

constexpr int kSteps = 10;
const BuildOptions kOneThread{.progress = {}, .threads = 1};

/// What the runs over a mesh found, by name.
struct Results {
  std::vector<std::string> names;  ///< in order
  std::map<std::string, std::vector<double>> found;

  void add(const std::string& name, double value) {
    if (found[name].empty()) names.push_back(name);
    found[name].push_back(value);
  }
  void print() const {
    for (const std::string& name : names)
      std::printf("  %-44s %10.3f\n", name.c_str(), median(found.at(name)));
  }
};

/// Adds the processor time of work(), in microseconds for each of `count`.
template <typename Work>
void time(Results& results, const std::string& name, size_t count, const Work& work) {
  const double start = thread_seconds();
  work();
  results.add(name, 1e6 * (thread_seconds() - start) / static_cast<double>(count));
}

bool meet(const Vec3& low, const Vec3& high, const Aabb& b) {
  return low.x <= b.max.x && high.x >= b.min.x && low.y <= b.max.y && high.y >= b.min.y &&
         low.z <= b.max.z && high.z >= b.min.z;
}

/// As DynamicTree::overlaps.
std::vector<uint32_t> overlaps(const bvh::Bvh2& tree, const Aabb& box) {
  std::vector<uint32_t> found;
  bvh::traverse(
      tree, [&](const bvh::Node& node) { return meet(node.min, node.max, box); },
      [&](std::span<const uint32_t> primitives) {
        found.insert(found.end(), primitives.begin(), primitives.end());
        return true;
      });
  std::sort(found.begin(), found.end());
  return found;
}

Aabb moved(const Aabb& box, const Vec3& by) { return {box.min + by, box.max + by}; }

class Runs {
 public:
  explicit Runs(std::vector<Aabb> boxes) : boxes_(std::move(boxes)), shuffled_(boxes_.size()) {
    std::iota(shuffled_.begin(), shuffled_.end(), 0u);
    std::shuffle(shuffled_.begin(), shuffled_.end(), random_);
    const Aabb all = DynamicTree::build(boxes_, {}, kOneThread).bounds();
    diagonal_ = length(all.max - all.min);
    const float half = diagonal_ / 100;
    for (size_t i = 0; i < std::min<size_t>(boxes_.size(), 2000); ++i) {
      const Vec3 at = boxes_[shuffled_[i]].min;
      queries_.push_back({at - Vec3{half, half, half}, at + Vec3{half, half, half}});
    }
  }

  void run() {
    DynamicTree tree;
    time(results, "build, us/box", boxes_.size(),
         [&] { tree = DynamicTree::build(boxes_, {}, kOneThread); });
    measure(tree, "built");
    take_out_and_put_in(tree);
    insert_only("in the mesh's order", [](uint32_t i) { return i; });
    insert_only("in random order", [&](uint32_t i) { return shuffled_[i]; });
    move_some();
  }

  Results results;

 private:
  void measure(const DynamicTree& tree, const std::string& name) {
    results.add("SAH cost, " + name, tree.quality().sah_cost);
    size_t found = 0, same = 0;
    time(results, "query, " + name + ", us", queries_.size(), [&] {
      for (const Aabb& query : queries_) found += tree.overlaps(query).size();
    });
    const bvh::Bvh2 snapshot = tree.snapshot(1);
    time(results, "query, " + name + ", snapshot, us", queries_.size(), [&] {
      for (const Aabb& query : queries_) same += overlaps(snapshot, query).size();
    });
    if (same != found) bench::fail(name, "a snapshot gives other boxes");
    results.add("boxes a query, " + name, double(found) / double(queries_.size()));
  }

  void take_out_and_put_in(DynamicTree& tree) {
    const size_t half = boxes_.size() / 2;
    time(results, "removal, us", half, [&] {
      for (size_t i = 0; i < half; ++i) tree.remove(shuffled_[i]);
    });
    time(results, "insertion, us", half, [&] {
      for (size_t i = half; i-- > 0;) tree.insert(boxes_[shuffled_[i]]);
    });
    measure(tree, "half out and in");
  }

  template <typename Order>
  void insert_only(const std::string& name, const Order& order) {
    DynamicTree tree;
    time(results, "insertion " + name + ", us", boxes_.size(), [&] {
      for (uint32_t i = 0; i < boxes_.size(); ++i) tree.insert(boxes_[order(i)]);
    });
    measure(tree, "inserted " + name);
  }

  void move_some() {
    DynamicTree by_move = DynamicTree::build(boxes_, {}, kOneThread);
    DynamicTree by_refit = DynamicTree::build(boxes_, {}, kOneThread);
    const std::vector<uint32_t> some(shuffled_.begin(),
                                     shuffled_.begin() + std::ptrdiff_t(boxes_.size() / 10));
    std::vector<Aabb> there;
    for (const uint32_t i : some) there.push_back(boxes_[i]);
    double moving = 0, refitting = 0;
    for (int step = 0; step < kSteps; ++step) {
      for (Aabb& box : there) box = moved(box, random_step());
      double start = thread_seconds();
      for (size_t i = 0; i < some.size(); ++i) by_move.move(some[i], there[i]);
      moving += thread_seconds() - start;
      start = thread_seconds();
      by_refit.refit(some, there);
      refitting += thread_seconds() - start;
    }
    const double count = double(kSteps) * double(some.size());
    results.add("move, us", 1e6 * moving / count);
    results.add("refit, us/box", 1e6 * refitting / count);
    measure(by_move, "after moves");
    measure(by_refit, "after refits");
    time(results, "rebuild, us/box", boxes_.size(), [&] { by_refit.rebuild({}, kOneThread); });
    measure(by_refit, "rebuilt");
  }

  Vec3 random_step() {
    std::normal_distribution<float> some;
    const Vec3 v{some(random_), some(random_), some(random_)};
    return v * (diagonal_ / 100 / length(v));
  }

  std::mt19937 random_{1};
  std::vector<Aabb> boxes_;
  std::vector<uint32_t> shuffled_;
  std::vector<Aabb> queries_;
  float diagonal_ = 0;
};

}  // namespace

int main(int argc, char** argv) {
  int runs = 3;
  const auto files = bench::read_arguments(
      argc, argv, {{"--runs", [&](uint64_t n) { runs = static_cast<int>(n); }}},
      "[--runs N] MESH.ply...");
  for (const std::string& file : files) {
    const Mesh mesh = bench::read_mesh(file);
    Runs of_mesh(triangle_boxes(mesh.view(), kOneThread));
    for (int run = 0; run < runs; ++run) of_mesh.run();
    std::printf("%s: %zu boxes\n", bench::file_name(file).c_str(), mesh.triangles.size());
    of_mesh.results.print();
    std::fflush(stdout);
  }
}
