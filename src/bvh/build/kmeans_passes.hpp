// k-means clustering from the top down for any executor: passes over all clusters of a level at
// once, as in Meister & Bittner, "Parallel BVH Construction using k-means Clustering", 2016. Chunks
// of items are the units of work, each of a team; what they sum up is integers, and where an item
// goes follows from counts, so the same clusters come out whatever the order in which chunks are
// done. Sizes are read back once a level.
#pragma once

#include <utility>
#include <vector>

#include "bvh/build/kmeans_assign.hpp"
#include "bvh/build/kmeans_medians.hpp"
#include "bvh/build/kmeans_seeding.hpp"
#include "bvh/build/kmeans_times.hpp"

namespace umbel::bvh {

/// Seeds a cluster that is divided, and clears what will be added up.
template <KmeansDistance kDistance, uint32_t kMost>
struct KmeansSeed {
  static constexpr uint32_t kLanes = 32;
  using Shared = KmeansSeedingShared<kMost>;

  KmeansPoints points;
  KmeansDivided* divided;
  float* nearest;
  KmeansPoint* representatives;  ///< k a cluster
  KmeansTotals totals;
  uint32_t k, candidates;
  bool evenly;  ///< without any

  template <typename Team>
  UMBEL_HOST_DEVICE void operator()(const Team& team, size_t i, Shared& shared) const {
    KmeansDivided& of = divided[i];
    for (uint32_t r = team.rank(); r < k; r += team.size()) {
      totals.counts[i * k + r] = 0;
      totals.sums[i * k + r] = {};
    }
    uint32_t used = 1;
    if (!evenly) {
      KmeansSeeding<kDistance, kMost, Team> seeding(team, points, *of.cluster,
                                                    nearest + of.cluster->offset, shared);
      used = seeding.run(k, candidates);
      seeding.write(representatives + i * k);
    }
    if (team.rank() == 0) of.used = used;
  }
};

/// Seeds a cluster again if all its items have one label: means of a few distant items may coincide
/// once rounded.
template <KmeansDistance kDistance, uint32_t kMost>
struct KmeansReseed {
  static constexpr uint32_t kLanes = 32;
  using Shared = KmeansSeedingShared<kMost>;

  KmeansPoints points;
  KmeansDivided* divided;
  float* nearest;
  KmeansPoint* representatives;  ///< k a cluster
  uint32_t* counts;              ///< k a cluster
  uint32_t k;

  template <typename Team>
  UMBEL_HOST_DEVICE void operator()(const Team& team, size_t i, Shared& shared) const {
    KmeansDivided& of = divided[i];
    const KmeansCluster& cluster = *of.cluster;
    uint32_t most = 0;
    for (uint32_t r = team.rank(); r < k; r += team.size())
      if (counts[i * k + r] > most) most = counts[i * k + r];
    most = team.reduce(most, [](uint32_t a, uint32_t b) { return a > b ? a : b; });
    const bool is_undivided = most == cluster.count;
    if (team.rank() == 0) of.is_reseeded = is_undivided;
    if (!is_undivided) return;
    for (uint32_t r = team.rank(); r < k; r += team.size()) counts[i * k + r] = 0;
    KmeansSeeding<kDistance, kMost, Team> seeding(team, points, cluster, nearest + cluster.offset,
                                                  shared);
    const uint32_t used = seeding.choose_farthest();
    seeding.write(representatives + i * k);
    if (team.rank() == 0) of.used = used;
  }
};

/// Moves the items of a chunk to those of the same label, in their old order.
template <uint32_t kMost>
struct KmeansMove {
  using Label = KmeansLabel<kMost>;
  static constexpr uint32_t kLanes = 128;
  struct Shared {
    uint32_t next[kMost];
    uint32_t targets[KmeansChunk::kMost];
    Label labels[KmeansChunk::kMost];
  };

  KmeansPoints from, to;
  const KmeansDivided* divided;
  const KmeansChunk* chunks;
  const Label* labels;
  const uint32_t* starts;  ///< the sums of KmeansTotals::chunk_counts
  uint32_t k;

  template <typename Team>
  UMBEL_HOST_DEVICE void operator()(const Team& team, size_t index, Shared& shared) const {
    const KmeansChunk chunk = chunks[index];
    const KmeansDivided& of = divided[chunk.cluster];
    const uint32_t count = chunk.end - chunk.begin;
    const uint32_t* of_cluster = starts + size_t(of.first_chunk) * k;
    const auto first_of = [&](uint32_t r) {
      return of.cluster->offset + of_cluster[size_t(r) * of.chunks + (index - of.first_chunk)] -
             of_cluster[0];
    };
    for (uint32_t i = team.rank(); i < count; i += team.size())
      shared.labels[i] = labels[chunk.begin + i];
    team.sync();
    if constexpr (Team::kIsSerial) {
      for (uint32_t r = 0; r < k; ++r) shared.next[r] = first_of(r);
      for (uint32_t i = 0; i < count; ++i) shared.targets[i] = shared.next[shared.labels[i]]++;
    } else {
      // Each lane has labels of its own.
      for (uint32_t r = team.rank(); r < k; r += team.size()) {
        uint32_t at = first_of(r);
        for (uint32_t i = 0; i < count; ++i)
          if (shared.labels[i] == r) shared.targets[i] = at++;
      }
    }
    team.sync();
    for (int v = 0; v < 6; ++v)
      for (uint32_t i = team.rank(); i < count; i += team.size())
        to.column[v][shared.targets[i]] = from.column[v][chunk.begin + i];
    for (uint32_t i = team.rank(); i < count; i += team.size())
      to.primitives[shared.targets[i]] = from.primitives[chunk.begin + i];
  }
};

/// For k of at most kMost.
template <typename Exec, uint32_t kMost = kMostKmeansClusters>
class KmeansPasses {
 public:
  using Label = KmeansLabel<kMost>;
  template <typename T>
  using Buffer = typename Exec::template Buffer<T>;

  /// Clusters of at most `stop` items are not divided. n > 0 boxes.
  KmeansPasses(Exec& exec, const Aabb* boxes, uint32_t n, const KmeansConfig& config, uint32_t stop)
      : exec_(exec), config_(config), n_(n), stop_(stop) {
    for (auto& points : points_) points = make_points();
    labels_ = exec.template allocate<Label>(n);
    nearest_ = exec.template allocate<float>(Exec::kSerialTeams ? n : 0);
    clusters_ = exec.template allocate<KmeansCluster>(2 * size_t(n));
    // As many as there can be: how many there are is known only later.
    const uint32_t most = most_divided();
    const size_t k = config.clusters, chunks = most_chunks();
    for (auto& divided : divided_) divided = exec.template allocate<KmeansDivided>(most + 1);
    sizes_ = exec.template allocate<Sizes>(1);
    chunks_ = exec.template allocate<KmeansChunk>(chunks);
    representatives_ = exec.template allocate<KmeansPoint>(most * k);
    counts_ = exec.template allocate<uint32_t>(most * k);
    sums_ = exec.template allocate<KmeansSum>(most * k);
    chunk_counts_ = exec.template allocate<uint32_t>(chunks * k + 1);
    take_boxes(boxes);
  }

  /// Divides until nothing is left to divide; report(fraction) between passes.
  template <typename Report>
  void run(const Report& report) {
    const bool divides = n_ > stop_;
    levels_ = {0, 1};
    size_ = {1, divides ? 1u : 0u, divides ? KmeansChunk::of(n_) : 0u};
    // One pass with as many as there can be needs all the memory there is.
    if (exec_.counts()) size_ = {1, most_divided(), most_chunks()};
    while (size_.divided > 0) {
      report(1 - 1 / double(levels_.size()));
      if (config_.distance == KmeansDistance::kEuclidean)
        divide<KmeansDistance::kEuclidean>();
      else
        divide<KmeansDistance::kManhattan>();
      if (exec_.counts()) break;
    }
  }

  /// All clusters, those of a level after those of the one above.
  const KmeansCluster* clusters() const { return clusters_.data(); }
  /// Where each level begins, and the end of the last one.
  const std::vector<uint32_t>& levels() const { return levels_; }
  /// The items of the clusters of a level that are not divided.
  const KmeansPoints& items(size_t level) const { return points_[level % 2].view; }
  /// Clusters of a level, at most.
  uint32_t most_of_level() const {
    const uint64_t most = uint64_t(most_divided()) * config_.clusters;
    return most < 1 ? 1 : static_cast<uint32_t>(most < n_ ? most : n_);
  }
  KmeansTimes& times() { return times_; }

  // The steps. They are public because CUDA takes no lambdas from private members.

  void take_boxes(const Aabb* boxes) {
    StageClock clock;
    exec_.for_each(
        n_, [=, n = n_, to = points_[0].view, labels = labels_.data(), clusters = clusters_.data(),
             divided = divided_[0].data()] UMBEL_DEVICE_LAMBDA(size_t i) {
          to.put(i, boxes[i], static_cast<uint32_t>(i));
          labels[i] = 0;
          if (i > 0) return;
          clusters[0] = {0, n};
          divided[0] = {clusters, 0, KmeansChunk::of(n), 0, {0, 0}, false};
        });
    auto scene = exec_.template allocate<Aabb>(1);
    exec_.reduce(
        // NOLINTNEXTLINE(clang-analyzer-security.ArrayBound): i is less than n_
        n_, Aabb{}, [=] UMBEL_DEVICE_LAMBDA(size_t i) { return boxes[i]; },
        [] UMBEL_DEVICE_LAMBDA(Aabb a, const Aabb& b) {
          extend(a, b);
          return a;
        },
        scene.data());
    grid_ = KmeansGrid::around(exec_.read(scene.data()));
    clock.lap(times_.boxes);
  }

  /// Deeper clusters are divided evenly. Distance divides well long before that, or not at all.
  static constexpr size_t kMaxLevel = 48;

  struct Points {
    Buffer<float> columns[6];
    Buffer<uint32_t> primitives;
    KmeansPoints view;
  };

  /// Of a level.
  struct Sizes {
    uint32_t clusters;
    uint32_t divided, chunks;  ///< those that are divided
  };

  Points make_points() {
    Points points;
    for (int c = 0; c < 6; ++c) {
      points.columns[c] = exec_.template allocate<float>(n_ + kKmeansBlock);
      points.view.column[c] = points.columns[c].data();
    }
    points.primitives = exec_.template allocate<uint32_t>(n_);
    points.view.primitives = points.primitives.data();
    return points;
  }

  uint32_t most_divided() const { return n_ / (stop_ + 1); }
  uint32_t most_chunks() const { return n_ / KmeansChunk::kMost + most_divided(); }
  /// The last level.
  size_t level() const { return levels_.size() - 2; }
  KmeansDivided* divided() { return divided_[level() % 2].data(); }
  KmeansTotals totals() { return {counts_.data(), sums_.data(), chunk_counts_.data()}; }

  /// Divides the clusters of the last level.
  template <KmeansDistance kDistance>
  void divide() {
    StageClock clock;
    list_chunks();
    clock.lap(times_.sizes);
    exec_.for_each_team(size_.divided,
                        KmeansSeed<kDistance, kMost>{
                            items(level()), divided(), nearest_.data(), representatives_.data(),
                            totals(), config_.clusters, config_.candidates, level() >= kMaxLevel});
    clock.lap(times_.seeding);
    iterate<kDistance>();
    clock.lap(times_.iterations);
    const Sizes last = size_;
    number_parts();
    clock.lap(times_.sizes);
    move_items(last.chunks);
    clock.lap(times_.reordering);
  }

  void list_chunks() {
    exec_.for_each(size_.chunks, [divided = divided(), count = size_.divided,
                                  chunks = chunks_.data()] UMBEL_DEVICE_LAMBDA(size_t c) {
      uint32_t low = 0, high = count;  // its cluster is `low`, or behind it and before `high`
      while (high - low > 1) {
        const uint32_t middle = low + (high - low) / 2;
        (divided[middle].first_chunk <= c ? low : high) = middle;
      }
      const KmeansCluster& cluster = *divided[low].cluster;
      const uint32_t from =
          (static_cast<uint32_t>(c) - divided[low].first_chunk) * KmeansChunk::kMost;
      const uint32_t left = cluster.count - from;
      const uint32_t size = left < KmeansChunk::kMost ? left : KmeansChunk::kMost;
      chunks[c] = {low, cluster.offset + from, cluster.offset + from + size};
    });
  }

  template <KmeansDistance kDistance>
  void iterate() {
    constexpr bool kMeans = kDistance == KmeansDistance::kEuclidean;
    for (uint32_t pass = 1; pass <= config_.iterations + 1; ++pass) {
      if (pass > 1) move_representatives<kDistance>(pass);
      assign<kDistance>(pass, kMeans && pass <= config_.iterations);
    }
    if (config_.iterations == 0) return;
    exec_.for_each_team(
        size_.divided,
        KmeansReseed<kDistance, kMost>{items(level()), divided(), nearest_.data(),
                                       representatives_.data(), counts_.data(), config_.clusters});
    assign<kDistance>(KmeansDivided::kReseeded, false);
  }

  template <KmeansDistance kDistance>
  void assign(uint32_t pass, bool adds) {
    exec_.for_each_team(size_.chunks,
                        KmeansAssign<kDistance, kMost>{
                            items(level()), divided(), chunks_.data(), representatives_.data(),
                            labels_.data(), totals(), grid_, config_.clusters, pass, adds});
  }

  /// To the means or medians of what was assigned in the pass before, whose totals are cleared.
  template <KmeansDistance kDistance>
  void move_representatives(uint32_t pass) {
    constexpr bool kMeans = kDistance == KmeansDistance::kEuclidean;
    if constexpr (!kMeans)
      KmeansMedians<Exec>(exec_).run(items(level()), n_, chunks_.data(), size_.chunks,
                                     labels_.data(), counts_.data(), size_.divided,
                                     config_.clusters, representatives_.data());
    exec_.for_each(
        size_t(size_.divided) * config_.clusters,
        [=, divided = divided(), totals = totals(), representatives = representatives_.data(),
         grid = grid_, k = config_.clusters] UMBEL_DEVICE_LAMBDA(size_t i) {
          const KmeansDivided& of = divided[i / k];
          if (!of.takes_part(pass)) return;
          const uint32_t count = totals.counts[i];
          if (kMeans && count > 0)
            for (uint32_t v = 0; v < 6; ++v)
              representatives[i].v[v] = grid.mean(totals.sums[i].v[v], count, v);
          totals.counts[i] = 0;
          totals.sums[i] = {};
        });
  }

  /// Makes a cluster of the items of each representative that has any, and lists those that will be
  /// divided.
  void number_parts() {
    const uint32_t k = config_.clusters, end = levels_.back(), stop = stop_, count = size_.divided;
    auto starts = exec_.template allocate<uint64_t>(count + size_t{1});
    auto chunk_starts = exec_.template allocate<uint32_t>(count + size_t{1});
    // Parts, and above them those that will be divided.
    exec_.exclusive_scan(
        count,
        [=, counts = counts_.data()] UMBEL_DEVICE_LAMBDA(size_t i) -> uint64_t {
          uint64_t sum = 0;
          for (uint32_t r = 0; r < k; ++r)
            sum += (counts[i * k + r] > 0 ? 1 : 0) |
                   (counts[i * k + r] > stop ? uint64_t{1} << 32 : 0);
          return sum;
        },
        starts.data());
    exec_.exclusive_scan(
        count,
        [=, counts = counts_.data()] UMBEL_DEVICE_LAMBDA(size_t i) -> uint32_t {
          uint32_t sum = 0;
          for (uint32_t r = 0; r < k; ++r)
            if (counts[i * k + r] > stop) sum += KmeansChunk::of(counts[i * k + r]);
          return sum;
        },
        chunk_starts.data());
    exec_.for_each(count, [=, counts = counts_.data(), starts = starts.data(),
                           chunk_starts = chunk_starts.data(), divided = divided(),
                           next = divided_[(level() + 1) % 2].data(), clusters = clusters_.data(),
                           sizes = sizes_.data()] UMBEL_DEVICE_LAMBDA(size_t i) {
      KmeansCluster& whole = *divided[i].cluster;
      whole.first = end + static_cast<uint32_t>(starts[i]);
      whole.parts = static_cast<uint32_t>(starts[i + 1] - starts[i]);
      KmeansCluster* part = clusters + whole.first;
      KmeansDivided* to = next + (starts[i] >> 32);
      uint32_t offset = whole.offset, chunk = chunk_starts[i];
      for (uint32_t r = 0; r < k; ++r) {
        const uint32_t items = counts[i * k + r];
        if (items == 0) continue;
        *part = {offset, items};
        if (items > stop) {
          *to++ = {part, chunk, KmeansChunk::of(items), 0, {0, 0}, false};
          chunk += KmeansChunk::of(items);
        }
        ++part;
        offset += items;
      }
      if (i + 1 == count)
        *sizes = {static_cast<uint32_t>(starts[count]), static_cast<uint32_t>(starts[count] >> 32),
                  chunk_starts[count]};
    });
    size_ = exec_.read(sizes_.data());
    levels_.push_back(end + size_.clusters);
  }

  /// Moves the items of each new cluster together, in their old order.
  void move_items(uint32_t chunks) {
    exec_.exclusive_scan(
        size_t(chunks) * config_.clusters,
        [counts = chunk_counts_.data()] UMBEL_DEVICE_LAMBDA(size_t i) { return counts[i]; },
        chunk_counts_.data());
    const size_t last = level() - 1;
    exec_.for_each_team(
        chunks,
        KmeansMove<kMost>{items(last), items(last + 1), divided_[last % 2].data(), chunks_.data(),
                          labels_.data(), chunk_counts_.data(), config_.clusters});
  }

 private:
  Exec& exec_;
  KmeansConfig config_;
  uint32_t n_, stop_;
  KmeansGrid grid_;
  Points points_[2];  ///< items of level i are in points_[i % 2]
  Buffer<Label> labels_;
  Buffer<float> nearest_;  ///< for single threads: distances of items to their representatives
  Buffer<KmeansCluster> clusters_;
  std::vector<uint32_t> levels_;
  Sizes size_{};                      ///< of the last level
  Buffer<Sizes> sizes_;               ///< the same, in the executor's memory
  Buffer<KmeansDivided> divided_[2];  ///< those of level i are in divided_[i % 2]
  // Of the clusters that are being divided.
  Buffer<KmeansChunk> chunks_;
  Buffer<KmeansPoint> representatives_;  ///< k a cluster
  Buffer<uint32_t> counts_;              ///< KmeansTotals
  Buffer<KmeansSum> sums_;
  Buffer<uint32_t> chunk_counts_;
  KmeansTimes times_;
};

}  // namespace umbel::bvh
