// Binned SAH (Wald, "On fast construction of SAH-based bounding volume hierarchies", 2007): every
// node is split at the cheapest plane of a regular grid over its centroids, on three axes.
//
// What is binned and moved are boxes rounded to 15 bits a coordinate. Where the grid has become too
// coarse for the node they are rounded again, from the boxes themselves. The last few primitives
// are swept exactly, and node boxes are those of the input.
//
// All threads split large nodes together, then build subtrees side by side into memory of their
// own, and at last copy them together, depth-first.
#include <array>
#include <cstring>
#include <memory>
#include <numeric>
#include <optional>

#include "base/big_vector.hpp"
#include "base/cpu_buffer.hpp"
#include "base/in_order.hpp"
#include "base/parallel.hpp"
#include "base/shared_progress.hpp"
#include "bvh/build/builders.hpp"
#include "bvh/build/emitter.hpp"
#include "bvh/build/short_bins.hpp"
#include "bvh/build/small_sweep.hpp"
#include "bvh/build/tree_parts.hpp"
#include "bvh/tree/box_node.hpp"
#include "bvh/tree/config.hpp"

namespace umbel::bvh {
namespace {

constexpr uint32_t kBlock = 1 << 12;  ///< primitives of a subtree that one thread builds
constexpr uint32_t kChunk = 1 << 14;  ///< primitives of a large node that one thread takes
constexpr uint32_t kExact = 2048;     ///< primitives from which on splits between planes count
constexpr uint32_t kUpper = 16;       ///< and the part of all that these are, at least
constexpr float kCoarse = 1.0f / 16;  ///< of the grid's size; smaller nodes get their own

/// Records that are being split, and as much memory to move them to.
struct Records {
  ShortBox* now;
  ShortBox* spare;
  Records after(uint32_t count) const { return {spare + count, now + count}; }
};

float longest_of(const ShortBounds& bounds, const ShortBoxGrid& grid) {
  const Float4 e = steps_of(bounds.box) * grid.unit;
  return std::max({e[0], e[1], e[2]});
}

template <typename Body>
void for_chunks(uint32_t count, const Body& body) {
  parallel_chunks(count, kChunk, [&](size_t begin, size_t end) {
    body(static_cast<uint32_t>(begin), static_cast<uint32_t>(end));
  });
}

ShortBounds bounds_in_parallel(const ShortBox* boxes, uint32_t count) {
  std::vector<ShortBounds> parts((count + kChunk - 1) / kChunk);
  for_chunks(count, [&](uint32_t begin, uint32_t end) {
    parts[begin / kChunk] = bounds_of(boxes + begin, end - begin);
  });
  ShortBounds all;
  for (const ShortBounds& part : parts) all.extend(part);
  return all;
}

/// Rounds the boxes again, to a grid that just holds them.
ShortBoxGrid round_again(Boxes boxes, ShortBox* records, uint32_t count) {
  std::vector<Box4> parts((count + kChunk - 1) / kChunk);
  for_chunks(count, [&](uint32_t begin, uint32_t end) {
    Box4 part = Box4::empty();
    for (uint32_t i = begin; i < end; ++i) part.extend(Box4::load(boxes[tag_of(records[i])]));
    parts[begin / kChunk] = part;
  });
  Box4 all = Box4::empty();
  for (const Box4& part : parts) all.extend(part);
  const ShortBoxGrid grid(all);
  for_chunks(count, [&](uint32_t begin, uint32_t end) {
    for (uint32_t i = begin; i < end; ++i) {
      const uint32_t tag = tag_of(records[i]);
      records[i] = grid.rounded(boxes[tag], tag);
    }
  });
  return grid;
}

/// Halves the records by centre along the longest axis, or in their order where all centres agree.
uint32_t halve(ShortBox* records, uint32_t count, const ShortBounds& bounds,
               const ShortBoxGrid& grid) {
  int axis = 0;
  float longest = 0;
  for (int k = 0; k < 3; ++k) {
    const float range = float(-int(bounds.centers[k + 4]) - int(bounds.centers[k])) * grid.unit[k];
    if (range > longest) {
      longest = range;
      axis = k;
    }
  }
  const uint32_t middle = count / 2;
  if (longest > 0) {
    std::nth_element(records, records + middle, records + count,
                     [axis](const ShortBox& a, const ShortBox& b) {
                       const int p = int(a[axis]) - int(a[axis + 4]);
                       const int q = int(b[axis]) - int(b[axis + 4]);
                       return p != q ? p < q : tag_of(a) < tag_of(b);
                     });
  }
  return middle;
}

/// Builds a subtree on one thread.
// NOLINTNEXTLINE(clang-analyzer-optin.performance.Padding): there is one a task
class Block {
 public:
  Block(Boxes boxes, const Config& config, Emitter& out)
      : boxes_(boxes),
        config_(config),
        out_(out),
        exact_(std::max(kExact, uint32_t(boxes.size()) / kUpper)),
        small_(boxes, out),
        bins_(config.bins) {}

  BuiltSubtree split(Records records, uint32_t count, ShortBoxGrid grid, uint32_t slot,
                     uint32_t depth) {
    if (count <= SmallSweep::kMost) {
      for (uint32_t i = 0; i < count; ++i) small_.ids()[i] = tag_of(records.now[i]);
      return small_.build(count, slot, depth);
    }
    ShortBounds bounds = bounds_of(records.now, count);
    if (longest_of(bounds, grid) < grid.longest * kCoarse) {
      grid = round_again(boxes_, records.now, count);
      bounds = bounds_of(records.now, count);
    }
    const ShortSplit chosen = divide(records, count, bounds, grid, depth);
    const uint32_t pair = out_.add_pair();
    BuiltSubtree left, right;
    const auto go_left = [&] {
      left = split(records.after(0), chosen.left_count, grid, pair, depth + 1);
    };
    const auto go_right = [&] {
      right = split(records.after(chosen.left_count), count - chosen.left_count, grid, pair + 1,
                    depth + 1);
    };
    if (chosen.left_area >= chosen.right_area) {
      go_left();
      go_right();
    } else {
      go_right();
      go_left();
    }
    return out_.join(slot, pair, count, left, right, splat(0.0f));
  }

 private:
  /// Moves the records to the spare room, those of the left child first.
  ShortSplit divide(Records records, uint32_t count, const ShortBounds& bounds,
                    const ShortBoxGrid& grid, uint32_t depth) {
    const ShortBinning binning(bounds, grid, config_.bins);
    binning.clear(bins_.data());
    binning.add(records.now, count, bins_.data());
    ShortSplit split = binning.cheapest(bins_.data(), count, planes_);
    if (count > exact_) {
      const ShortWindows windows = binning.windows(planes_, count, split);
      if (windows.any) {
        for (std::vector<uint64_t>& items : items_) items.clear();
        ShortBinning::collect(records.now, 0, count, windows, items_);
        split = binning.search(records.now, bins_.data(), count, planes_, windows, items_, split);
      }
    }
    const uint32_t larger = std::max(split.left_count, count - split.left_count);
    if (split.axis < 0 || !fits_depth(larger, out_.max_depth - depth - 1)) {
      split.left_count = halve(records.now, count, bounds, grid);
      std::copy_n(records.now, count, records.spare);
      return split;
    }
    partition(records.now, count, split, records.spare, records.spare + split.left_count);
    return split;
  }

  Boxes boxes_;
  const Config& config_;
  Emitter& out_;
  uint32_t exact_;
  SmallSweep small_;
  std::vector<ShortBin> bins_;
  ShortPlanes planes_;
  ShortItems items_;
};

/// A node above the blocks, or a block.
struct Top {
  Box4 box;
  std::unique_ptr<Top> left, right;
  uint32_t begin, count;  ///< primitives
  // Of a block:
  Records records{};                   ///< not needed any more; its nodes lie there
  std::unique_ptr<Node[]> more_nodes;  ///< those for which there is no room
  uint32_t node_count = 0;
};

/// Memory for the nodes of the block that this thread builds.
Node* scratch_nodes() {
  thread_local std::array<Node, 2 * size_t(kBlock)> nodes;
  return nodes.data();
}

/// Calls visit(nodes, count, first) for the pieces in which a block's nodes are kept.
template <typename Visit>
void for_pieces(const Top& block, const Visit& visit) {
  const uint32_t room = block.count * sizeof(ShortBox) / sizeof(Node), all = block.node_count;
  const uint32_t first = std::min(room, all), second = std::min(2 * room, all);
  visit(reinterpret_cast<Node*>(block.records.now), first, 0u);
  visit(reinterpret_cast<Node*>(block.records.spare), second - first, first);
  visit(block.more_nodes.get(), all - second, second);
}

void keep(const Node* nodes, Top& block) {
  const uint32_t room = 2 * (block.count * sizeof(ShortBox) / sizeof(Node));
  if (block.node_count > room)
    block.more_nodes = std::make_unique_for_overwrite<Node[]>(block.node_count - room);
  for_pieces(block, [&](Node* to, uint32_t count, uint32_t first) {
    if (count > 0) std::memcpy(to, nodes + first, count * sizeof(Node));
  });
}

class Binned {
 public:
  Binned(Boxes boxes, const Config& config, Progress& progress)
      : boxes_(boxes),
        config_(config),
        count_(uint32_t(boxes.size())),
        progress_(progress, "binning", 0.1, 0.9, count_) {}

  Bvh2 build() {
    records_ = CpuBuffer<ShortBox>(2 * size_t(count_));
    primitives_ = CpuBuffer<uint32_t>(count_);
    const ShortBoxGrid grid = round_all();
    const std::unique_ptr<Top> root =
        split({records_.data(), records_.data() + count_}, 0, count_, grid, 0);
    progress_.finish();
    return assemble(*root);
  }

 private:
  ShortBoxGrid round_all() {
    std::vector<Box4> parts((count_ + kChunk - 1) / kChunk);
    for_chunks(count_, [&](uint32_t begin, uint32_t end) {
      Box4 part = Box4::empty();
      for (uint32_t i = begin; i < end; ++i) part.extend(Box4::load(boxes_[i]));
      parts[begin / kChunk] = part;
    });
    Box4 all = Box4::empty();
    for (const Box4& part : parts) all.extend(part);
    const ShortBoxGrid grid(all);
    for_chunks(count_, [&](uint32_t begin, uint32_t end) {
      for (uint32_t i = begin; i < end; ++i) records_[i] = grid.rounded(boxes_[i], i);
    });
    return grid;
  }

  std::unique_ptr<Top> split(Records records, uint32_t begin, uint32_t count, ShortBoxGrid grid,
                             uint32_t depth) {
    auto top = std::make_unique<Top>();
    top->begin = begin;
    top->count = count;
    if (progress_.is_stopped()) return top;
    if (count <= kBlock) {
      build_block(records, grid, depth, *top);
      return top;
    }
    ShortBounds bounds = bounds_in_parallel(records.now, count);
    if (longest_of(bounds, grid) < grid.longest * kCoarse) {
      grid = round_again(boxes_, records.now, count);
      bounds = bounds_in_parallel(records.now, count);
    }
    const uint32_t left_count = divide(records, count, bounds, grid, depth);
    parallel_invoke(
        [&] { top->left = split(records.after(0), begin, left_count, grid, depth + 1); },
        [&] {
          top->right = split(records.after(left_count), begin + left_count, count - left_count,
                             grid, depth + 1);
        });
    // oneTBB skips what has not begun when a task runs out of memory.
    if (!top->left || !top->right) return top;
    top->box = top->left->box;
    top->box.extend(top->right->box);
    return top;
  }

  uint32_t divide(Records records, uint32_t count, const ShortBounds& bounds,
                  const ShortBoxGrid& grid, uint32_t depth) {
    // Narrow bins leave little to search between their planes, and cost nothing here.
    const uint32_t bins = std::min(4 * config_.bins, kMaxBins);
    const ShortBinning binning(bounds, grid, bins);
    const uint32_t chunks = (count + kChunk - 1) / kChunk;
    std::vector<ShortBin> parts(size_t(chunks) * bins), sum(bins);
    for_chunks(count, [&](uint32_t begin, uint32_t end) {
      ShortBin* part = parts.data() + size_t(begin / kChunk) * bins;
      binning.clear(part);
      binning.add(records.now + begin, end - begin, part);
    });
    binning.clear(sum.data());
    for (uint32_t c = 0; c < chunks; ++c)
      binning.merge(parts.data() + size_t(c) * bins, sum.data());
    const auto planes = std::make_unique_for_overwrite<ShortPlanes>();
    ShortSplit split = binning.cheapest(sum.data(), count, *planes);
    const ShortWindows windows = binning.windows(*planes, count, split);
    if (windows.any) {
      std::vector<ShortItems> found(chunks);
      for_chunks(count, [&](uint32_t begin, uint32_t end) {
        ShortBinning::collect(records.now + begin, begin, end - begin, windows,
                              found[begin / kChunk]);
      });
      for (uint32_t c = 1; c < chunks; ++c)
        for (int axis = 0; axis < 3; ++axis)
          found[0][axis].insert(found[0][axis].end(), found[c][axis].begin(), found[c][axis].end());
      split = binning.search(records.now, sum.data(), count, *planes, windows, found[0], split);
    }
    const uint32_t larger = std::max(split.left_count, count - split.left_count);
    if (split.axis < 0 || !fits_depth(larger, config_.max_depth - depth - 1)) {
      const uint32_t middle = halve(records.now, count, bounds, grid);
      std::copy_n(records.now, count, records.spare);
      return middle;
    }
    std::vector<uint32_t> left_in(chunks), left_before(chunks);
    // No chunk begins after the last.
    for_chunks((chunks - 1) * kChunk, [&](uint32_t begin, uint32_t end) {
      left_in[begin / kChunk] = count_left(records.now + begin, end - begin, split);
    });
    std::exclusive_scan(left_in.begin(), left_in.end(), left_before.begin(), 0u);
    const uint32_t left = split.left_count;
    for_chunks(count, [&](uint32_t begin, uint32_t end) {
      const uint32_t before = left_before[begin / kChunk];
      partition(records.now + begin, end - begin, split, records.spare + before,
                records.spare + left + (begin - before));
    });
    return left;
  }

  void build_block(Records records, const ShortBoxGrid& grid, uint32_t depth, Top& top) {
    Emitter out{scratch_nodes(), primitives_.data() + top.begin, config_.cost,
                config_.max_leaf_size, config_.max_depth};
    if (config_.reinsertion_rounds > 0) out.max_leaf_size = 1;
    Block block(boxes_, config_, out);
    top.box = block.split(records, top.count, grid, 0, depth).box;
    top.node_count = out.node_count;
    top.records = records;
    keep(out.nodes, top);
    progress_.add(top.count);
  }

  /// A block, and where it goes: its root, the nodes below it, its primitives.
  struct Copy {
    const Top* top;
    uint32_t slot, nodes, primitives;
  };

  void copy_block(const Copy& c, Node* nodes, std::vector<uint32_t>& primitives) const {
    std::copy_n(primitives_.data() + c.top->begin, c.top->count, primitives.data() + c.primitives);
    const auto moved = [&](Node node) {
      if (node.is_leaf())
        finish_leaf(node, c.primitives, primitives);
      else
        node.first += c.nodes - 1;
      return node;
    };
    for_pieces(*c.top, [&](const Node* from, uint32_t count, uint32_t first) {
      for (uint32_t k = 0; k < count; ++k)
        nodes[first + k == 0 ? c.slot : c.nodes + first + k - 1] = moved(from[k]);
    });
  }

  Bvh2 assemble(const Top& root) {
    struct Step {
      const Top* top;
      uint32_t slot;
    };
    std::vector<Step> stack{{&root, 0}};
    std::vector<Copy> copies;
    std::vector<Node> upper;
    std::vector<uint32_t> upper_slots;
    uint32_t nodes = 1, primitives = 0;
    while (!stack.empty()) {
      const Step s = stack.back();
      stack.pop_back();
      if (!s.top->left) {
        copies.push_back({s.top, s.slot, nodes, primitives});
        nodes += s.top->node_count - 1;
        primitives += s.top->count;
        continue;
      }
      upper.push_back(node_of(s.top->box, nodes, 0));
      upper_slots.push_back(s.slot);
      const Step left{s.top->left.get(), nodes}, right{s.top->right.get(), nodes + 1};
      nodes += 2;
      const float left_area = left.top->box.half_area(splat(0.0f));
      const bool left_first = left_area >= right.top->box.half_area(splat(0.0f));
      stack.push_back(left_first ? right : left);
      stack.push_back(left_first ? left : right);
    }
    Bvh2 tree;
    reserve_big(tree.nodes, nodes);
    tree.primitives.reserve(primitives);
    Node* const to = tree.nodes.data();
    struct None {};
    in_order<None>(
        copies.size(), [](size_t /*i*/, None& /*scratch*/) {},
        [&](size_t i, None& /*scratch*/) {
          const Copy& c = copies[i];
          tree.nodes.resize(c.nodes + c.top->node_count - 1);
          tree.primitives.resize(c.primitives + c.top->count);
        },
        [&](size_t i, None& /*scratch*/) { copy_block(copies[i], to, tree.primitives); });
    for (size_t i = 0; i < upper.size(); ++i) tree.nodes[upper_slots[i]] = upper[i];
    return tree;
  }

  Boxes boxes_;
  const Config& config_;
  const uint32_t count_;
  SharedProgress progress_;
  CpuBuffer<ShortBox> records_;
  CpuBuffer<uint32_t> primitives_;
};

}  // namespace

Bvh2 build_binned(Boxes boxes, const Config& config, BuildProgress& progress) {
  progress.report(0.1, "binning");
  return Binned(boxes, config, progress).build();
}

}  // namespace umbel::bvh
