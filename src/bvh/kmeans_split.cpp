// One step of k-means clustering on the processor. See the header.
#include "bvh/kmeans_split.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>

#include "base/parallel.hpp"

namespace umbel::bvh {
namespace {

constexpr uint32_t kBlock = 64;

/// Items with one array a component, for loops over neighbouring items.
struct Block {
  alignas(16) float v[6][kBlock];
  alignas(16) float nearest[kBlock];
  alignas(16) int32_t label[kBlock];
};

void load(Block& block, const KmeansItem* items, uint32_t count) {
  for (uint32_t i = 0; i < count; ++i) {
    const KmeansPoint p = point_of(items[i]);
    for (int c = 0; c < 6; ++c) block.v[c][i] = p.v[c];
  }
  for (uint32_t i = count; i % 4 != 0; ++i)
    for (auto& component : block.v) component[i] = 0;
}

/// Keeps the nearest representative of each item; of several as near, the one given first.
template <KmeansDistance kDistance>
void compare(Block& block, uint32_t padded, const KmeansPoint& representative, int32_t label) {
  const KmeansPoint r = representative;
  for (uint32_t i = 0; i < padded; ++i) {
    float sum = distance_along<kDistance>(block.v[0][i], r.v[0]);
    sum += distance_along<kDistance>(block.v[1][i], r.v[1]);
    sum += distance_along<kDistance>(block.v[2][i], r.v[2]);
    sum += distance_along<kDistance>(block.v[3][i], r.v[3]);
    sum += distance_along<kDistance>(block.v[4][i], r.v[4]);
    sum += distance_along<kDistance>(block.v[5][i], r.v[5]);
    const bool nearer = sum < block.nearest[i];
    block.nearest[i] = nearer ? sum : block.nearest[i];
    block.label[i] = nearer ? label : block.label[i];
  }
}

void add_block(const Block& block, uint32_t count, const KmeansGrid& grid, KmeansSum* sums) {
  alignas(16) int32_t cells[6][kBlock];
  const uint32_t padded = (count + 3) & ~3u;
  const std::array<float, 3> origin{grid.origin.x, grid.origin.y, grid.origin.z};
  for (uint32_t c = 0; c < 6; ++c) {
    const float low = origin[c % 3], scale = grid.scale;
    for (uint32_t i = 0; i < padded; ++i)
      cells[c][i] = static_cast<int32_t>((block.v[c][i] - low) * scale);
  }
  for (uint32_t i = 0; i < count; ++i) {
    KmeansSum& sum = sums[block.label[i]];
    for (uint32_t c = 0; c < 6; ++c) sum.v[c] += cells[c][i];
    ++sum.count;
  }
}

float median(float* values, size_t count) {
  const size_t middle = count / 2;
  std::nth_element(values, values + middle, values + count);
  if (count % 2 == 1) return values[middle];
  return *std::max_element(values, values + middle) * 0.5f + values[middle] * 0.5f;
}

}  // namespace

KmeansGrid KmeansGrid::around(const Aabb& scene) {
  const Vec3 extent = scene.max - scene.min;
  const float longest = std::max({extent.x, extent.y, extent.z});
  // The floor of the logarithm is at most one too small, so cells stay below 2^31.
  const int exponent = longest > 0 ? std::clamp(29 - std::ilogb(longest), -60, 120) : 0;
  return {scene.min, std::ldexp(1.0f, exponent), std::ldexp(1.0, -exponent)};
}

template <typename Body>
void KmeansSplitter::each_chunk(Cluster cluster, const Body& body) const {
  const auto chunk = [&](size_t c) {
    const auto begin = static_cast<uint32_t>(c * kChunk);
    body(c, begin, std::min(begin + kChunk, cluster.count));
  };
  const size_t chunks = (size_t{cluster.count} + kChunk - 1) / kChunk;
  if (cluster.parallel)
    parallel_for(chunks, 1, chunk);
  else
    for (size_t c = 0; c < chunks; ++c) chunk(c);
}

/// Chooses the candidate that is farthest from its nearest representative. False if none is apart.
template <KmeansDistance kDistance>
bool KmeansSplitter::add_best_candidate(Cluster cluster, KmeansDice dice) {
  // Few items: their distances are kept. Many: only those of the candidates are computed.
  const bool keep = cluster.count < config_.candidates * config_.clusters / 2;
  if (keep) {
    if (used_ == 1) nearest_.assign(cluster.count, std::numeric_limits<float>::max());
    const KmeansPoint last = representatives_[used_ - 1];
    for (uint32_t i = 0; i < cluster.count; ++i)
      nearest_[i] =
          std::min(nearest_[i], kmeans_distance<kDistance>(point_of(cluster.items[i]), last));
  }
  float farthest = 0;
  for (uint32_t c = 0; c < config_.candidates; ++c) {
    const uint32_t drawn = dice.draw(used_ * kMost + c, cluster.count);
    const KmeansPoint candidate = point_of(cluster.items[drawn]);
    float nearest = std::numeric_limits<float>::max();
    if (keep)
      nearest = nearest_[drawn];
    else
      for (uint32_t r = 0; r < used_; ++r)
        nearest = std::min(nearest, kmeans_distance<kDistance>(candidate, representatives_[r]));
    if (nearest <= farthest) continue;
    farthest = nearest;
    representatives_[used_] = candidate;
  }
  if (farthest == 0) return false;
  ++used_;
  return true;
}

template <KmeansDistance kDistance>
void KmeansSplitter::choose_representatives(Cluster cluster, KmeansDice dice) {
  representatives_[0] = point_of(cluster.items[dice.draw(0, cluster.count)]);
  used_ = 1;
  while (used_ < config_.clusters && add_best_candidate<kDistance>(cluster, dice)) {
  }
}

/// Where the dice found only one place: the first representative and the item farthest from it.
/// False if all items are at the same place.
template <KmeansDistance kDistance>
bool KmeansSplitter::choose_farthest(Cluster cluster) {
  representatives_[0] = point_of(cluster.items[0]);
  float farthest = 0;
  for (uint32_t i = 1; i < cluster.count; ++i) {
    const KmeansPoint p = point_of(cluster.items[i]);
    const float distance = kmeans_distance<kDistance>(representatives_[0], p);
    if (distance <= farthest) continue;
    farthest = distance;
    representatives_[1] = p;
  }
  used_ = 2;
  return farthest > 0;
}

/// Labels items and adds them up. True if a label changed.
template <KmeansDistance kDistance>
bool KmeansSplitter::assign_chunk(KmeansItem* items, uint32_t count, KmeansSum* sums) const {
  std::fill_n(sums, used_, KmeansSum{});
  int32_t changes = 0;
  Block block;
  for (uint32_t begin = 0; begin < count; begin += kBlock) {
    const uint32_t n = std::min(kBlock, count - begin), padded = (n + 3) & ~3u;
    load(block, items + begin, n);
    std::fill_n(block.nearest, padded, std::numeric_limits<float>::infinity());
    std::fill_n(block.label, padded, 0);
    for (uint32_t r = 0; r < used_; ++r)
      compare<kDistance>(block, padded, representatives_[r], static_cast<int32_t>(r));
    for (uint32_t i = 0; i < n; ++i) {
      KmeansItem& item = items[begin + i];
      const auto label = static_cast<uint32_t>(block.label[i]);
      changes |= static_cast<int32_t>(item.label ^ label);
      item.label = label;
    }
    add_block(block, n, grid_, sums);
  }
  return changes != 0;
}

template <KmeansDistance kDistance>
bool KmeansSplitter::assign(Cluster cluster) {
  if (cluster.count <= kChunk) return assign_chunk<kDistance>(cluster.items, cluster.count, sums_);
  const size_t chunks = (size_t{cluster.count} + kChunk - 1) / kChunk;
  chunk_sums_.resize(chunks * used_);
  std::vector<uint8_t> changed(chunks);
  each_chunk(cluster, [&](size_t chunk, uint32_t begin, uint32_t end) {
    changed[chunk] =
        assign_chunk<kDistance>(cluster.items + begin, end - begin, &chunk_sums_[chunk * used_]);
  });
  std::fill_n(sums_, used_, KmeansSum{});
  for (size_t i = 0; i < chunk_sums_.size(); ++i) {
    KmeansSum& sum = sums_[i % used_];
    for (int c = 0; c < 6; ++c) sum.v[c] += chunk_sums_[i].v[c];
    sum.count += chunk_sums_[i].count;
  }
  return std::find(changed.begin(), changed.end(), 1) != changed.end();
}

uint32_t KmeansSplitter::nonempty() const {
  return static_cast<uint32_t>(
      std::count_if(sums_, sums_ + used_, [](const KmeansSum& sum) { return sum.count > 0; }));
}

void KmeansSplitter::move_to_means() {
  const std::array<double, 3> origin{grid_.origin.x, grid_.origin.y, grid_.origin.z};
  for (uint32_t r = 0; r < used_; ++r) {
    const KmeansSum& sum = sums_[r];
    if (sum.count == 0) continue;
    const double cell = grid_.cell / static_cast<double>(sum.count);
    for (uint32_t c = 0; c < 6; ++c)
      representatives_[r].v[c] =
          static_cast<float>(origin[c % 3] + static_cast<double>(sum.v[c]) * cell);
  }
}

void KmeansSplitter::move_to_medians(Cluster cluster) {
  values_.resize(size_t{cluster.count} * 6);
  const auto move_component = [&](size_t c) {
    float* values = &values_[c * cluster.count];
    std::array<uint32_t, kMost> next;
    uint32_t sum = 0;
    for (uint32_t r = 0; r < used_; ++r) {
      next[r] = sum;
      sum += static_cast<uint32_t>(sums_[r].count);
    }
    for (uint32_t i = 0; i < cluster.count; ++i) {
      const KmeansItem& item = cluster.items[i];
      values[next[item.label]++] = point_of(item).v[c];
    }
    for (uint32_t r = 0; r < used_; ++r) {
      const size_t count = sums_[r].count;
      if (count > 0) representatives_[r].v[c] = median(values + next[r] - count, count);
    }
  };
  if (cluster.parallel)
    parallel_for(6, 1, move_component);
  else
    for (size_t c = 0; c < 6; ++c) move_component(c);
}

/// Moves the items of each representative together; representatives without items vanish.
std::span<const uint32_t> KmeansSplitter::gather(Cluster cluster, KmeansItem* moved) {
  const uint32_t chunks = (cluster.count + kChunk - 1) / kChunk;
  if (cluster.count <= kChunk) {
    chunk_sums_.resize(used_);
    std::copy_n(sums_, used_, chunk_sums_.begin());
  }
  std::vector<uint32_t> starts(size_t{chunks} * used_);
  uint32_t start = 0;
  for (uint32_t r = 0; r < used_; ++r) {
    for (uint32_t chunk = 0; chunk < chunks; ++chunk) {
      const size_t cell = size_t{chunk} * used_ + r;
      starts[cell] = start;
      start += static_cast<uint32_t>(chunk_sums_[cell].count);
    }
  }
  each_chunk(cluster, [&](size_t chunk, uint32_t begin, uint32_t end) {
    uint32_t* next = &starts[chunk * used_];
    for (uint32_t i = begin; i < end; ++i) moved[next[cluster.items[i].label]++] = cluster.items[i];
  });
  sizes_.clear();
  for (uint32_t r = 0; r < used_; ++r)
    if (sums_[r].count > 0) sizes_.push_back(static_cast<uint32_t>(sums_[r].count));
  return sizes_;
}

std::span<const uint32_t> KmeansSplitter::split_evenly(const KmeansItem* items, KmeansItem* moved,
                                                       uint32_t count) {
  std::copy_n(items, count, moved);
  const uint32_t parts = std::min(config_.clusters, count);
  sizes_.resize(parts);
  for (uint32_t i = 0; i < parts; ++i) {
    const uint64_t begin = uint64_t{count} * i / parts, end = uint64_t{count} * (i + 1) / parts;
    sizes_[i] = static_cast<uint32_t>(end - begin);
  }
  return sizes_;
}

template <KmeansDistance kDistance>
std::span<const uint32_t> KmeansSplitter::split_by(Cluster cluster, KmeansItem* moved,
                                                   KmeansDice dice) {
  StageClock clock;
  choose_representatives<kDistance>(cluster, dice);
  clock.lap(times_.seeding);
  if (used_ == 1 && !choose_farthest<kDistance>(cluster))
    return split_evenly(cluster.items, moved, cluster.count);
  assign<kDistance>(cluster);
  for (uint32_t i = 0; i < config_.iterations; ++i) {
    if constexpr (kDistance == KmeansDistance::kEuclidean)
      move_to_means();
    else
      move_to_medians(cluster);
    if (!assign<kDistance>(cluster)) break;
  }
  if (nonempty() < 2) {
    // Means of a few distant items may coincide once rounded.
    if (!choose_farthest<kDistance>(cluster))
      return split_evenly(cluster.items, moved, cluster.count);
    assign<kDistance>(cluster);
  }
  clock.lap(times_.iterations);
  const std::span<const uint32_t> sizes = gather(cluster, moved);
  clock.lap(times_.reordering);
  return sizes;
}

std::span<const uint32_t> KmeansSplitter::split(KmeansItem* items, KmeansItem* moved,
                                                uint32_t offset, uint32_t count, bool parallel) {
  const Cluster cluster{items, count, parallel && count > kChunk};
  const KmeansDice dice = KmeansDice::of_cluster(offset, count);
  return config_.distance == KmeansDistance::kEuclidean
             ? split_by<KmeansDistance::kEuclidean>(cluster, moved, dice)
             : split_by<KmeansDistance::kManhattan>(cluster, moved, dice);
}

}  // namespace umbel::bvh
