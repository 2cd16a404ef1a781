#include "bvh/part_writer.hpp"

#include <tbb/parallel_pipeline.h>
#include <tbb/task_arena.h>

#include <mutex>
#include <utility>

#include "base/cpu_buffer.hpp"

namespace umbel::bvh {
namespace {

/// A child: a node above the parts, or ~part. And the node that it is in the tree.
struct Step {
  uint32_t id, slot;
};

struct Placed {
  TreePart part;
  uint32_t base;  ///< of the nodes below it
};

class PartWriter {
 public:
  PartWriter(std::span<const TopNode> top, const MostNodes& most, std::vector<uint32_t> primitives,
             const BuildPart& build)
      : top_(top), pairs_(top.size()), slots_(top.size()), most_(most), build_(build) {
    tree_.primitives = std::move(primitives);
    tree_.nodes.reserve(most.tree);
    prefer_huge_pages(tree_.nodes.data(), most.tree * sizeof(Node));
    tree_.nodes.resize(1);
    nodes_ = tree_.nodes.data();
    steps_.push_back({top.empty() ? ~0u : 0u, 0});
  }

  Bvh2 run() {
    const auto threads = static_cast<size_t>(tbb::this_task_arena::max_concurrency());
    if (threads == 1 || top_.empty()) {
      const Scratch scratch(most_.part);
      for (const uint32_t part : in_order()) write(placed(build_(part, end_of(scratch))));
    } else {
      run_parallel(2 * threads);
    }
    unite_top();
    return std::move(tree_);
  }

 private:
  using Scratch = CpuBuffer<Node>;
  struct Job {
    uint32_t number;
    Scratch* scratch;
    Placed placed;
  };

  static Node* end_of(const Scratch& scratch) { return scratch.data() + scratch.size(); }

  /// The parts from left to right.
  std::vector<uint32_t> in_order() const {
    std::vector<uint32_t> parts, open{steps_[0].id};
    while (!open.empty()) {
      const uint32_t id = open.back();
      open.pop_back();
      if (static_cast<int32_t>(id) < 0) {
        parts.push_back(~id);
      } else {
        open.push_back(top_[id].right);
        open.push_back(top_[id].left);
      }
    }
    return parts;
  }

  void run_parallel(size_t at_once) {
    const std::vector<uint32_t> parts = in_order();
    std::vector<Scratch> all(at_once);
    std::vector<Scratch*> unused;
    for (Scratch& scratch : all) unused.push_back(&scratch);
    std::mutex mutex;
    size_t next = 0;
    const auto begin = [&](tbb::flow_control& control) -> Job {
      if (next == parts.size()) {
        control.stop();
        return {};
      }
      const std::lock_guard lock(mutex);
      Scratch* scratch = unused.back();
      unused.pop_back();
      return {parts[next++], scratch, {}};
    };
    const auto build = [&](Job job) {
      if (job.scratch->size() == 0) *job.scratch = Scratch(most_.part);
      job.placed.part = build_(job.number, end_of(*job.scratch));
      return job;
    };
    const auto place = [&](Job job) {
      job.placed = placed(job.placed.part);
      return job;
    };
    const auto finish = [&](const Job& job) {
      write(job.placed);
      const std::lock_guard lock(mutex);
      unused.push_back(job.scratch);
    };
    using tbb::filter_mode, tbb::make_filter;
    tbb::parallel_pipeline(at_once, make_filter<void, Job>(filter_mode::serial_in_order, begin) &
                                        make_filter<Job, Job>(filter_mode::parallel, build) &
                                        make_filter<Job, Job>(filter_mode::serial_in_order, place) &
                                        make_filter<Job, void>(filter_mode::parallel, finish));
  }

  /// The place of the part that is next in the order.
  Placed placed(const TreePart& part) {
    auto nodes = static_cast<uint32_t>(tree_.nodes.size());
    while (static_cast<int32_t>(steps_.back().id) >= 0) {
      const Step step = steps_.back();
      pairs_[step.id] = nodes;
      slots_[step.id] = step.slot;
      steps_.back() = {top_[step.id].right, nodes + 1};
      steps_.push_back({top_[step.id].left, nodes});
      nodes += 2;
    }
    const uint32_t slot = steps_.back().slot;
    steps_.pop_back();
    tree_.nodes.resize(nodes + 2 * size_t(part.pairs));
    Node& root = nodes_[slot];
    root = part.root;
    if (root.is_leaf())
      finish_leaf(root, part.leaf_base, tree_.primitives);
    else
      root.first = nodes;
    return {part, nodes};
  }

  void write(const Placed& placed) {
    copy_part(placed.part, placed.base, nodes_, tree_.primitives);
  }

  void unite_top() {
    for (size_t t = top_.size(); t-- > 0;) {
      const uint32_t pair = pairs_[t];
      Aabb box = tree_.nodes[pair].box();
      extend(box, tree_.nodes[pair + 1].box());
      tree_.nodes[slots_[t]] = {box.min, pair, box.max, 0};
    }
  }

  std::span<const TopNode> top_;
  std::vector<uint32_t> pairs_, slots_;  // of the nodes above: their children, themselves
  std::vector<Step> steps_;              // what is still to be placed, the next one last
  MostNodes most_;
  const BuildPart& build_;
  Bvh2 tree_;
  Node* nodes_ = nullptr;
};

}  // namespace

Bvh2 write_parts(std::span<const TopNode> top, const MostNodes& most,
                 std::vector<uint32_t> primitives, const BuildPart& build) {
  return PartWriter(top, most, std::move(primitives), build).run();
}

}  // namespace umbel::bvh
