// The recursion of k-means clustering over all clusters, whatever is made of them.
//
// Large clusters are divided one after the other by all threads, pass by pass; the others are tasks
// of one thread each, depth-first, in the cache. What comes out is the same either way, because
// every step depends on nothing but the items of its cluster.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "base/big_vector.hpp"
#include "base/parallel.hpp"
#include "bvh/builders.hpp"
#include "bvh/kmeans_split.hpp"

namespace umbel::bvh {

/// A Maker makes a Result of the items of a cluster that is small enough, and of the Results of a
/// cluster's parts:
///   Result leaf(const KmeansItem* items, uint32_t offset, uint32_t count);
///   Result inner(std::span<const Result> parts, uint32_t offset);
/// and, where it has memory of its own,
///   Result adopt(Maker& of_task, const Result& result);
template <typename Maker>
class KmeansRecursion {
 public:
  using Result = typename Maker::Result;

  /// Clusters of at most `stop` items are leaves. At least one box.
  KmeansRecursion(Boxes boxes, const KmeansConfig& config, uint32_t stop)
      : config_(config), stop_(stop) {
    for (auto& items : items_) items.resize(boxes.size());
    std::vector<Aabb> parts((boxes.size() + kChunk - 1) / kChunk);
    parallel_chunks(boxes.size(), kChunk, [&](size_t begin, size_t end) {
      Aabb part;
      for (size_t i = begin; i < end; ++i) {
        extend(part, boxes[i]);
        items_[0][i] = {boxes[i].min, static_cast<uint32_t>(i), boxes[i].max, 0};
      }
      parts[begin / kChunk] = part;
    });
    Aabb scene;
    for (const Aabb& part : parts) extend(scene, part);
    grid_ = KmeansGrid::around(scene);
  }

  Result run(Maker& maker, Progress& progress) {
    divide_large(progress);
    run_tasks(maker, progress);
    StageClock clock;
    for (size_t i = clusters_.size(); i-- > 0;) {
      Cluster& cluster = clusters_[i];
      if (cluster.parts > 0)
        results_[i] = maker.inner({&results_[cluster.first], cluster.parts}, cluster.offset);
    }
    clock.lap(times_.agglomeration);
    return results_[0];
  }

  /// Of the run.
  const KmeansTimes& times() const { return times_; }

 private:
  static constexpr uint32_t kTask = 1 << 14;  ///< items; they and their copies fit into the cache
  static constexpr size_t kChunk = 1 << 14;
  /// Deeper clusters are divided evenly. Distance divides well long before that, or not at all.
  static constexpr uint32_t kMaxLevel = 48;

  struct Cluster {
    uint32_t offset, count, level;
    uint32_t first = 0, parts = 0;  ///< the clusters that it was divided into; none for a task
  };

  std::span<const uint32_t> divide(KmeansSplitter& splitter, const Cluster& cluster,
                                   bool parallel) {
    KmeansItem* from = &items_[cluster.level % 2][cluster.offset];
    KmeansItem* to = &items_[(cluster.level + 1) % 2][cluster.offset];
    if (cluster.level >= kMaxLevel) return splitter.split_evenly(from, to, cluster.count);
    return splitter.split(from, to, cluster.offset, cluster.count, parallel);
  }

  void divide_large(Progress& progress) {
    KmeansSplitter splitter(config_, grid_);
    clusters_ = {{0, static_cast<uint32_t>(items_[0].size()), 0}};
    for (size_t i = 0; i < clusters_.size(); ++i) {
      const Cluster cluster = clusters_[i];
      if (cluster.count <= std::max(kTask, stop_)) continue;
      progress.report(0.3 * double(i) / double(clusters_.size()), "clustering");
      clusters_[i].first = static_cast<uint32_t>(clusters_.size());
      uint32_t offset = cluster.offset;
      for (const uint32_t size : divide(splitter, cluster, true)) {
        clusters_.push_back({offset, size, cluster.level + 1});
        offset += size;
      }
      clusters_[i].parts = static_cast<uint32_t>(clusters_.size()) - clusters_[i].first;
    }
    results_.resize(clusters_.size());
    times_ = splitter.times();
  }

  void run_tasks(Maker& maker, Progress& progress) {
    std::vector<uint32_t> tasks;
    for (uint32_t i = 0; i < clusters_.size(); ++i)
      if (clusters_[i].parts == 0) tasks.push_back(i);
    constexpr size_t kBatch = 256;  // between two reports
    for (size_t begin = 0; begin < tasks.size(); begin += kBatch) {
      progress.report(0.3 + 0.6 * double(begin) / double(tasks.size()), "clustering");
      const size_t count = std::min(kBatch, tasks.size() - begin);
      std::vector<Maker> makers(count, maker.for_task());
      std::vector<KmeansTimes> times(count);
      parallel_for(count, 1, [&](size_t i) {
        const uint32_t cluster = tasks[begin + i];
        Task task{*this, makers[i], {config_, grid_}, {}, 0};
        results_[cluster] = task.run(clusters_[cluster]);
        times[i] = task.splitter.times();
        times[i].agglomeration = task.making;
      });
      for (size_t i = 0; i < count; ++i) {
        times_ = times_ + times[i];
        Result& result = results_[tasks[begin + i]];
        result = maker.adopt(makers[i], result);
      }
    }
  }

  struct Task {
    KmeansRecursion& recursion;
    Maker& maker;
    KmeansSplitter splitter;
    std::vector<Result> stack;  ///< of parts whose cluster is not finished
    double making;              ///< seconds

    Result run(const Cluster& cluster) {
      const KmeansItem* items = &recursion.items_[cluster.level % 2][cluster.offset];
      if (cluster.count <= recursion.stop_) return make_leaf(items, cluster);
      const std::span<const uint32_t> sizes = recursion.divide(splitter, cluster, false);
      uint32_t part_sizes[64];
      const auto parts = static_cast<uint32_t>(sizes.size());
      std::copy_n(sizes.begin(), parts, part_sizes);
      uint32_t offset = cluster.offset;
      for (uint32_t i = 0; i < parts; ++i) {
        const Result part = run({offset, part_sizes[i], cluster.level + 1});
        stack.push_back(part);
        offset += part_sizes[i];
      }
      StageClock clock;
      const Result result = maker.inner(std::span(stack).last(parts), cluster.offset);
      clock.lap(making);
      stack.resize(stack.size() - parts);
      return result;
    }

    Result make_leaf(const KmeansItem* items, const Cluster& cluster) {
      StageClock clock;
      const Result result = maker.leaf(items, cluster.offset, cluster.count);
      clock.lap(making);
      return result;
    }
  };

  KmeansConfig config_;
  uint32_t stop_;
  KmeansGrid grid_;
  BigVector<KmeansItem> items_[2];  ///< those of level i are in items_[i % 2]
  std::vector<Cluster> clusters_;   ///< the large ones and the tasks, parts after wholes
  std::vector<Result> results_;
  KmeansTimes times_;
};

}  // namespace umbel::bvh
