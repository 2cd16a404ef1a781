// Linear BVH on the processor: the radix tree over sorted Morton codes (Karras, "Maximizing
// Parallelism in the Construction of BVHs, Octrees, and k-d Trees", 2012), divided into parts that
// MortonStack builds.
#include "base/morton.hpp"
#include "base/simd/box4.hpp"
#include "bvh/build/builders.hpp"
#include "bvh/build/radix_parts.hpp"
#include "bvh/tree/config.hpp"

namespace umbel::bvh {
namespace {

constexpr size_t kCodesAtOnce = size_t(1) << 14;

/// The box around the doubled centres.
Aabb centers_of(Boxes boxes) {
  std::vector<Box4> parts((boxes.size() + kCodesAtOnce - 1) / kCodesAtOnce);
  parallel_chunks(boxes.size(), kCodesAtOnce, [&](size_t begin, size_t end) {
    Box4 part = Box4::empty();
    for (size_t i = begin; i < end; ++i) {
      const Float4 center = Box4::load(boxes[i]).center2();
      part.extend({center, -center});
    }
    parts[begin / kCodesAtOnce] = part;
  });
  Box4 all = Box4::empty();
  for (const Box4& part : parts) all.extend(part);
  return all.box();
}

/// What MortonGrid::code gives, all three axes at once.
template <typename Key>
class Coder {
 public:
  explicit Coder(const MortonGrid& grid)
      : origin_{grid.origin.x, grid.origin.y, grid.origin.z, 0},
        scale_(splat(grid.scale)),
        last_(splat(grid.last)) {}

  Key operator()(const Aabb& box) const {
    const Float4 at = min4((Box4::load(box).center2() - origin_) * scale_, last_);
    const Int4 cell = __builtin_convertvector(at, Int4);
    const Pair xy = spread(Pair{uint32_t(cell[0]), uint32_t(cell[1])});
    const uint64_t z = spread_bits(uint64_t(uint32_t(cell[2])));
    return static_cast<Key>(xy[0] << 2 | xy[1] << 1 | z);
  }

 private:
  typedef uint64_t Pair __attribute__((vector_size(16)));

  /// As spread_bits.
  static Pair spread(Pair x) {
    x = (x | x << 32) & 0x001f00000000ffffu;
    x = (x | x << 16) & 0x001f0000ff0000ffu;
    x = (x | x << 8) & 0x100f00f00f00f00fu;
    x = (x | x << 4) & 0x10c30c30c30c30c3u;
    return (x | x << 2) & 0x1249249249249249u;
  }

  Float4 origin_, scale_, last_;
};

/// What morton_order gives.
template <typename Key>
MortonOrder<CpuExec, Key> ordered(Boxes boxes, uint32_t bits) {
  CpuExec exec;
  const size_t n = boxes.size();
  MortonOrder<CpuExec, Key> order{exec.allocate<Key>(n), exec.allocate<uint32_t>(n)};
  const Coder<Key> code(MortonGrid::around(centers_of(boxes), bits));
  parallel_chunks(n, kCodesAtOnce, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      order.codes[i] = code(boxes[i]);
      order.primitives[i] = static_cast<uint32_t>(i);
    }
  });
  exec.radix_sort_pairs(n, order.codes.data(), order.primitives.data(), 0u, 3 * bits);
  return order;
}

template <typename Key>
Bvh2 build(Boxes boxes, uint32_t bits, const Config& config, Progress& progress) {
  const auto n = static_cast<uint32_t>(boxes.size());
  const auto order = ordered<Key>(boxes, bits);
  progress.report(0.5, "building subtrees");
  RadixParts<Key> parts(order.codes.data());
  parts.add({0, n});
  Bvh2 tree =
      parts.build(boxes, {order.primitives.data(), order.primitives.data() + n}, LeafRule(config));
  if (config.max_depth < 3 * bits + balanced_depth(n)) limit_depth(tree, config.max_depth);
  return tree;
}

}  // namespace

Bvh2 build_lbvh(Boxes boxes, const Config& config, BuildProgress& progress) {
  return config.morton_bits <= 30
             ? build<uint32_t>(boxes, 10, config, progress)
             : build<uint64_t>(boxes, config.morton_bits / 3, config, progress);
}

}  // namespace umbel::bvh
