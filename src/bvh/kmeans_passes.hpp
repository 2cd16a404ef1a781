// k-means clustering from the top down for any executor: passes over all clusters of a level at
// once, as in Meister & Bittner, "Parallel BVH Construction using k-means Clustering", 2016. Chunks
// of items are the units of work; what they sum up is integers, and where an item goes follows from
// counts, so the same clusters come out whatever the order in which chunks are done.
#pragma once

#include <chrono>
#include <utility>
#include <vector>

#include "bvh/kmeans_assign.hpp"
#include "bvh/kmeans_medians.hpp"
#include "bvh/kmeans_seeding.hpp"

namespace umbel::bvh {

/// Adds the time since the last lap, or since it was made, to a stage.
class StageClock {
 public:
  void lap(double& stage) {
    const auto now = std::chrono::steady_clock::now();
    stage += std::chrono::duration<double>(now - last_).count();
    last_ = now;
  }

 private:
  std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
};

template <typename Exec>
class KmeansPasses {
 public:
  template <typename T>
  using Buffer = typename Exec::template Buffer<T>;

  /// Clusters of at most `stop` items are not divided. n > 0 boxes.
  KmeansPasses(Exec& exec, const Aabb* boxes, uint32_t n, const KmeansConfig& config, uint32_t stop)
      : exec_(exec), config_(config), n_(n), stop_(stop) {
    for (auto& points : points_) points = make_points();
    labels_ = exec.template allocate<uint8_t>(n + kKmeansBlock);
    nearest_ = exec.template allocate<float>(n);
    clusters_ = exec.template allocate<KmeansCluster>(2 * size_t(n));
    // As many as there can be: how many there are is known only later.
    const uint32_t most = most_divided();
    const size_t k = config.clusters, chunks = most_chunks();
    divided_ = exec.template allocate<Divided>(most);
    chunks_ = exec.template allocate<KmeansChunk>(chunks);
    changed_ = exec.template allocate<uint8_t>(chunks);
    representatives_ = exec.template allocate<KmeansPoint>(most * k);
    counts_ = exec.template allocate<uint32_t>(most * k);
    sums_ = exec.template allocate<KmeansSum>(chunks * k);
    take_boxes(boxes);
  }

  /// Divides until nothing is left to divide; report(fraction) between passes.
  template <typename Report>
  void run(const Report& report) {
    levels_ = {0, 1};
    while (find_divided()) {
      report(1 - 1 / double(levels_.size()));
      seed();
      if (config_.distance == KmeansDistance::kEuclidean)
        iterate<KmeansDistance::kEuclidean>();
      else
        iterate<KmeansDistance::kManhattan>();
      number_parts();
      move_items();
      if (exec_.counts()) break;  // one pass needs all the memory there is
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
    exec_.for_each(n_, [=, n = n_, to = points_[0].view, labels = labels_.data(),
                        clusters = clusters_.data()] UMBEL_DEVICE_LAMBDA(size_t i) {
      to.put(i, boxes[i], static_cast<uint32_t>(i));
      labels[i] = 0;
      if (i == 0) clusters[0] = {0, n};
    });
    auto scene = exec_.template allocate<Aabb>(1);
    exec_.reduce(
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
  static constexpr size_t kGrain = 16;  ///< chunks or clusters of one task

  struct Points {
    Buffer<float> columns[6];
    Buffer<uint32_t> primitives;
    KmeansPoints view;
  };

  /// What a cluster that is being divided needs beside its items.
  struct Divided {
    KmeansCluster* cluster;
    uint32_t first_chunk, chunks;
    uint32_t used;  ///< representatives; one: divided evenly
    bool settled;   ///< labels do not change any more
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
  const KmeansPoints& current() const { return points_[levels_.size() % 2].view; }

  /// Lists the clusters of the last level that are to be divided, and their chunks.
  bool find_divided() {
    StageClock clock;
    const uint32_t begin = levels_[levels_.size() - 2];
    const uint32_t size = exec_.counts() ? most_of_level() : levels_.back() - begin;
    KmeansCluster* clusters = clusters_.data() + begin;
    auto indices = exec_.template allocate<uint32_t>(size);
    auto count = exec_.template allocate<uint32_t>(1);
    exec_.select(
        size, [=, stop = stop_] UMBEL_DEVICE_LAMBDA(size_t i) { return clusters[i].count > stop; },
        indices.data(), count.data());
    count_ = exec_.counts() ? most_divided() : exec_.read(count.data());
    if (count_ == 0) return false;
    auto starts = exec_.template allocate<uint32_t>(count_ + 1);
    exec_.exclusive_scan(
        count_,
        [=, indices = indices.data()] UMBEL_DEVICE_LAMBDA(size_t i) -> uint32_t {
          return (clusters[indices[i]].count + KmeansChunk::kMost - 1) / KmeansChunk::kMost;
        },
        starts.data());
    chunk_count_ = exec_.counts() ? most_chunks() : exec_.read(starts.data() + count_);
    exec_.for_each(count_,
                   [=, indices = indices.data(), starts = starts.data(), divided = divided_.data(),
                    chunks = chunks_.data()] UMBEL_DEVICE_LAMBDA(size_t i) {
                     KmeansCluster& cluster = clusters[indices[i]];
                     divided[i] = {&cluster, starts[i], starts[i + 1] - starts[i], 0, false};
                     for (uint32_t k = 0; k < divided[i].chunks; ++k) {
                       const uint32_t from = k * KmeansChunk::kMost, left = cluster.count - from;
                       const uint32_t size = left < KmeansChunk::kMost ? left : KmeansChunk::kMost;
                       chunks[starts[i] + k] = {static_cast<uint32_t>(i), cluster.offset + from,
                                                cluster.offset + from + size};
                     }
                   });
    clock.lap(times_.sizes);
    return true;
  }

  void seed() {
    StageClock clock;
    if (config_.distance == KmeansDistance::kEuclidean)
      seed_by<KmeansDistance::kEuclidean>();
    else
      seed_by<KmeansDistance::kManhattan>();
    clock.lap(times_.seeding);
  }

  template <KmeansDistance kDistance>
  void seed_by() {
    exec_.for_each(
        count_,
        [points = current(), divided = divided_.data(), nearest = nearest_.data(),
         representatives = representatives_.data(), k = config_.clusters, p = config_.candidates,
         evenly = levels_.size() - 2 >= kMaxLevel] UMBEL_DEVICE_LAMBDA(size_t i) {
          const KmeansCluster& cluster = *divided[i].cluster;
          KmeansSeeding<kDistance> seeding(points, cluster, nearest + cluster.offset,
                                           representatives + i * k);
          divided[i].used = evenly ? 1 : seeding.run(k, p);
        },
        kGrain);
  }

  template <KmeansDistance kDistance>
  void iterate() {
    StageClock clock;
    constexpr bool kMeans = kDistance == KmeansDistance::kEuclidean;
    assign_all<kDistance>(kMeans && config_.iterations > 0);
    for (uint32_t i = 0; i < config_.iterations; ++i) {
      count_labels();
      move_representatives<kDistance>();
      assign_all<kDistance>(kMeans && i + 1 < config_.iterations);
      settle();
    }
    count_labels();
    if (config_.iterations > 0) mend<kDistance>();
    clock.lap(times_.iterations);
  }

  /// Assigns the items of all clusters that are not settled; `adds`: for new means.
  template <KmeansDistance kDistance>
  void assign_all(bool adds) {
    exec_.for_each(
        chunk_count_,
        [points = current(), divided = divided_.data(), chunks = chunks_.data(),
         representatives = representatives_.data(), labels = labels_.data(), sums = sums_.data(),
         changed = changed_.data(), grid = grid_, adds,
         k = config_.clusters] UMBEL_DEVICE_LAMBDA(size_t c) {
          const KmeansChunk chunk = chunks[c];
          const Divided& of = divided[chunk.cluster];
          if (of.settled) return;
          if (of.used == 1) {
            assign_evenly(*of.cluster, chunk, k, labels, sums + c * k);
            changed[c] = 0;
            return;
          }
          changed[c] =
              bvh::assign<kDistance>(points, chunk, representatives + size_t(chunk.cluster) * k,
                                     of.used, grid, adds, labels, sums + c * k);
        },
        kGrain);
  }

  /// Items of each representative.
  void count_labels() {
    exec_.for_each(size_t(count_) * config_.clusters,
                   [divided = divided_.data(), sums = sums_.data(), counts = counts_.data(),
                    k = config_.clusters] UMBEL_DEVICE_LAMBDA(size_t i) {
                     const Divided& of = divided[i / k];
                     const uint32_t r = i % k, parts = of.used == 1 ? k : of.used;
                     uint32_t count = 0;
                     for (uint32_t c = 0; r < parts && c < of.chunks; ++c)
                       count +=
                           static_cast<uint32_t>(sums[(of.first_chunk + c) * size_t(k) + r].count);
                     counts[i] = count;
                   });
  }

  template <KmeansDistance kDistance>
  void move_representatives() {
    if constexpr (kDistance == KmeansDistance::kManhattan) {
      KmeansMedians<Exec>(exec_).run(current(), chunks_.data(), chunk_count_, labels_.data(),
                                     counts_.data(), count_, config_.clusters,
                                     representatives_.data());
      return;
    }
    exec_.for_each(size_t(count_) * config_.clusters,
                   [divided = divided_.data(), sums = sums_.data(), counts = counts_.data(),
                    representatives = representatives_.data(), grid = grid_,
                    k = config_.clusters] UMBEL_DEVICE_LAMBDA(size_t i) {
                     const Divided& of = divided[i / k];
                     if (counts[i] == 0 || of.used == 1 || of.settled) return;
                     KmeansSum sum{};
                     for (uint32_t c = 0; c < of.chunks; ++c) {
                       const KmeansSum& part = sums[(of.first_chunk + c) * size_t(k) + i % k];
                       for (int v = 0; v < 6; ++v) sum.v[v] += part.v[v];
                     }
                     for (uint32_t v = 0; v < 6; ++v)
                       representatives[i].v[v] = grid.mean(sum.v[v], counts[i], v);
                   });
  }

  void settle() {
    exec_.for_each(count_, [divided = divided_.data(),
                            changed = changed_.data()] UMBEL_DEVICE_LAMBDA(size_t i) {
      Divided& of = divided[i];
      bool any = false;
      for (uint32_t c = 0; c < of.chunks; ++c) any |= changed[of.first_chunk + c] != 0;
      of.settled |= of.used == 1 || !any;
    });
  }

  /// Divides anew what all items of have one label: means of a few distant items may coincide once
  /// rounded.
  template <KmeansDistance kDistance>
  void mend() {
    auto broken = exec_.template allocate<uint32_t>(1);
    exec_.reduce(
        count_, uint32_t{0},
        [divided = divided_.data(), counts = counts_.data(),
         k = config_.clusters] UMBEL_DEVICE_LAMBDA(size_t i) -> uint32_t {
          const uint32_t whole = divided[i].cluster->count;
          bool is_broken = false;
          for (uint32_t r = 0; r < k; ++r) is_broken |= counts[i * k + r] == whole;
          divided[i].settled = !is_broken;
          return is_broken;
        },
        [] UMBEL_DEVICE_LAMBDA(uint32_t a, uint32_t b) { return a + b; }, broken.data());
    if (exec_.read(broken.data()) == 0) return;
    exec_.for_each(
        count_,
        [points = current(), divided = divided_.data(), nearest = nearest_.data(),
         representatives = representatives_.data(),
         k = config_.clusters] UMBEL_DEVICE_LAMBDA(size_t i) {
          if (divided[i].settled) return;
          const KmeansCluster& cluster = *divided[i].cluster;
          KmeansSeeding<kDistance> seeding(points, cluster, nearest + cluster.offset,
                                           representatives + i * k);
          divided[i].used = seeding.choose_farthest();
        },
        kGrain);
    assign_all<kDistance>(false);
    count_labels();
  }

  /// Makes a cluster of the items of each representative that has any.
  void number_parts() {
    StageClock clock;
    const uint32_t k = config_.clusters, end = levels_.back();
    auto firsts = exec_.template allocate<uint32_t>(count_ + 1);
    exec_.exclusive_scan(
        count_,
        [=, counts = counts_.data()] UMBEL_DEVICE_LAMBDA(size_t i) -> uint32_t {
          uint32_t parts = 0;
          for (uint32_t r = 0; r < k; ++r) parts += counts[i * k + r] > 0 ? 1 : 0;
          return parts;
        },
        firsts.data());
    exec_.for_each(count_,
                   [=, counts = counts_.data(), firsts = firsts.data(), divided = divided_.data(),
                    clusters = clusters_.data()] UMBEL_DEVICE_LAMBDA(size_t i) {
                     KmeansCluster& whole = *divided[i].cluster;
                     whole.first = end + firsts[i];
                     whole.parts = firsts[i + 1] - firsts[i];
                     KmeansCluster* part = clusters + whole.first;
                     uint32_t offset = whole.offset;
                     for (uint32_t r = 0; r < k; ++r) {
                       if (counts[i * k + r] == 0) continue;
                       *part++ = {offset, counts[i * k + r]};
                       offset += counts[i * k + r];
                     }
                   });
    levels_.push_back(end + exec_.read(firsts.data() + count_));
    clock.lap(times_.sizes);
  }

  /// Moves the items of each new cluster together, in their old order.
  void move_items() {
    StageClock clock;
    const uint32_t k = config_.clusters;
    const KmeansPoints from = points_[(levels_.size() - 1) % 2].view, to = current();
    // The sums' counts become where the items of a chunk and a representative go.
    exec_.for_each(size_t(count_) * k, [=, divided = divided_.data(), sums = sums_.data(),
                                        counts = counts_.data()] UMBEL_DEVICE_LAMBDA(size_t i) {
      if (counts[i] == 0) return;
      const Divided& of = divided[i / k];
      uint32_t at = of.cluster->offset;
      for (size_t r = i - i % k; r < i; ++r) at += counts[r];
      for (uint32_t c = 0; c < of.chunks; ++c) {
        uint64_t& count = sums[(of.first_chunk + c) * size_t(k) + i % k].count;
        const auto items = static_cast<uint32_t>(count);
        count = at;
        at += items;
      }
    });
    exec_.for_each(
        chunk_count_,
        [=, chunks = chunks_.data(), sums = sums_.data(),
         labels = labels_.data()] UMBEL_DEVICE_LAMBDA(size_t c) {
          const KmeansChunk chunk = chunks[c];
          const uint32_t count = chunk.end - chunk.begin;
          uint32_t places[KmeansChunk::kMost];
          for (uint32_t i = 0; i < count; ++i)
            places[i] = static_cast<uint32_t>(sums[c * k + labels[chunk.begin + i]].count++);
          for (int v = 0; v < 6; ++v)
            for (uint32_t i = 0; i < count; ++i)
              to.column[v][places[i]] = from.column[v][chunk.begin + i];
          for (uint32_t i = 0; i < count; ++i)
            to.primitives[places[i]] = from.primitives[chunk.begin + i];
        },
        kGrain);
    clock.lap(times_.reordering);
  }

 private:
  Exec& exec_;
  KmeansConfig config_;
  uint32_t n_, stop_;
  KmeansGrid grid_;
  Points points_[2];  ///< items of level i are in points_[i % 2]
  Buffer<uint8_t> labels_;
  Buffer<float> nearest_;  ///< distance of each item to its nearest representative
  Buffer<KmeansCluster> clusters_;
  std::vector<uint32_t> levels_;
  // Of the clusters that are being divided.
  uint32_t count_ = 0, chunk_count_ = 0;
  Buffer<Divided> divided_;
  Buffer<KmeansChunk> chunks_;
  Buffer<uint8_t> changed_;              ///< of each chunk: a label
  Buffer<KmeansPoint> representatives_;  ///< k a cluster
  Buffer<uint32_t> counts_;              ///< k a cluster: items of a representative
  Buffer<KmeansSum> sums_;               ///< k a chunk
  KmeansTimes times_;
};

}  // namespace umbel::bvh
