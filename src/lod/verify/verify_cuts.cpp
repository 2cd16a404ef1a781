// Verification of cuts: random ones, half by error and half by camera from inside and outside the
// mesh, and one a level. Each is selected in both ways and its triangles are counted edge by edge.
#include "lod/verify/verify_cuts.hpp"

#include <tbb/enumerable_thread_specific.h>

#include <cmath>

#include "base/math.hpp"
#include "base/parallel.hpp"
#include "lod/verify/edge_count.hpp"
#include "umbel/lod/select.hpp"

namespace umbel::lod {
namespace {

constexpr size_t kKept = 3;
constexpr size_t kMostLevels = 64;  // far more than halving ever makes

/// SplitMix64 (Steele, Lea & Flood 2014): the same numbers on every platform.
class Random {
 public:
  explicit Random(uint64_t seed) : state_(seed) {}
  uint64_t next() {
    uint64_t z = (state_ += 0x9e3779b97f4a7c15ull);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ull;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebull;
    return z ^ (z >> 31);
  }
  double uniform() { return static_cast<double>(next() >> 11) * 0x1p-53; }
  double between(double low, double high) { return low + (high - low) * uniform(); }
  double log_between(double low, double high) {
    return std::exp(between(std::log(low), std::log(high)));
  }

 private:
  uint64_t state_;
};

/// The views that the random cuts are seen from.
class ViewMaker {
 public:
  ViewMaker(const Tables& tables, uint32_t seed) : tables_(tables), random_(seed) {
    Aabb box;
    for (const Cluster& cluster : tables.clusters) extend(box, cluster.box);
    low_[0] = box.min.x, low_[1] = box.min.y, low_[2] = box.min.z;
    high_[0] = box.max.x, high_[1] = box.max.y, high_[2] = box.max.z;
    double square = 0;
    for (int i = 0; i < 3; ++i) square += (high_[i] - low_[i]) * (high_[i] - low_[i]);
    diagonal_ = std::sqrt(square);
    if (!(diagonal_ > 0)) diagonal_ = 1;
    for (const Group& group : tables.groups) {
      if (!std::isfinite(group.error) || !(group.error > 0)) continue;
      smallest_ = smallest_ == 0 ? group.error : std::min<double>(smallest_, group.error);
      largest_ = std::max<double>(largest_, group.error);
    }
    if (largest_ == 0) smallest_ = largest_ = diagonal_;
  }

  View make(uint32_t index) { return index % 2 == 0 ? by_error() : by_camera(); }

 private:
  View by_error() {
    // Equality is a case of its own, so some of the errors are those of groups.
    if (random_.uniform() < 0.25) {
      const float error = tables_.groups[random_.next() % tables_.groups.size()].error;
      if (std::isfinite(error) && error >= 0) return view_error(error);
    }
    return view_error(static_cast<float>(random_.log_between(smallest_, largest_)));
  }

  View by_camera() {
    double eye[3];
    for (int i = 0; i < 3; ++i) eye[i] = random_.between(low_[i], high_[i]);
    double distance = random_.log_between(0.01, 1) * diagonal_;
    if (random_.uniform() < 0.5) {
      distance = random_.log_between(0.1, 100) * diagonal_;
      const double z = random_.between(-1, 1), angle = random_.between(0, 6.283185307179586);
      const double r = std::sqrt(1 - z * z);
      const double direction[3] = {r * std::cos(angle), r * std::sin(angle), z};
      for (int i = 0; i < 3; ++i)
        eye[i] = 0.5 * (low_[i] + high_[i]) + direction[i] * (0.5 * diagonal_ + distance);
    }
    View view;
    view.kind = View::Kind::kCamera;
    view.eye = {clamped(eye[0]), clamped(eye[1]), clamped(eye[2])};
    view.threshold = std::max(0.0f, clamped(random_.log_between(smallest_, largest_) / distance));
    return view;
  }

  static float clamped(double value) {
    constexpr double kMax = std::numeric_limits<float>::max();
    if (std::isnan(value)) return 0;  // of boxes that are damaged
    return static_cast<float>(std::clamp(value, -kMax, kMax));
  }

  const Tables& tables_;
  Random random_;
  double low_[3], high_[3], diagonal_ = 1, smallest_ = 0, largest_ = 0;
};

std::string view_text(const View& view) {
  if (view.kind == View::Kind::kError) return "The cut of error " + text(view.error);
  if (view.kind == View::Kind::kLevel) return "The cut of level " + number(view.level);
  return "The cut seen from " + text(view.eye) + " with the threshold " + text(view.threshold);
}

struct CutResult {
  uint64_t cracks = 0, overlaps = 0;
  std::vector<BadEdge> first_cracks, first_overlaps;
  bool same = true;  ///< both ways of selection agree
  bool empty = false;
};

CutResult examine(const Tables& tables, const View& view, EdgeCount& edges) {
  const std::vector<uint32_t> cut = select(tables, view);
  CutResult result;
  result.same = cut == select_hierarchy(tables, view);
  result.empty = cut.empty();
  edges.count(cut, [&](const BadEdge& bad) {
    const bool crack = bad.triangles < 2;
    ++(crack ? result.cracks : result.overlaps);
    auto& kept = crack ? result.first_cracks : result.first_overlaps;
    if (kept.size() < kKept) kept.push_back(bad);
  });
  return result;
}

void name(const Topology& topology, const View& view, const CutResult& result, bool may_be_empty,
          Findings& findings) {
  const auto bad_text = [&](const BadEdge& bad) {
    return " at " + topology.edge_text(bad.edge) + " of cluster " + number(bad.cluster);
  };
  for (size_t i = 0; i < result.first_cracks.size(); ++i)
    findings.crack(
        [&] {
          return view_text(view) + " is open" + bad_text(result.first_cracks[i]) + " (" +
                 number(result.cracks) + " such edges)";
        },
        i == 0 ? result.cracks : 0);
  for (size_t i = 0; i < result.first_overlaps.size(); ++i) {
    const BadEdge& bad = result.first_overlaps[i];
    findings.overlap(
        [&] {
          return view_text(view) + " has " + number(bad.triangles) + " triangles" + bad_text(bad) +
                 " (" + number(result.overlaps) + " such edges)";
        },
        i == 0 ? result.overlaps : 0);
  }
  if (!result.same)
    findings.other([&] {
      return view_text(view) + " is not the same through the hierarchy as by testing every cluster";
    });
  if (result.empty && !may_be_empty)
    findings.other([&] { return view_text(view) + " is empty, though the source is not"; });
}

}  // namespace

void verify_cuts(const Tables& tables, const Topology& topology, const VerifyConfig& config,
                 uint32_t& cuts, Findings& findings, Progress& progress) {
  constexpr size_t kBatch = 16;
  findings.begin_stage();
  if (tables.groups.empty()) {
    cuts = config.cuts;  // of nothing
    return;
  }
  const size_t levels = std::min(tables.levels.size(), kMostLevels);
  std::vector<View> views;
  views.reserve(size_t{config.cuts} + levels + 1);
  ViewMaker maker(tables, config.seed);
  for (uint32_t i = 0; i < config.cuts; ++i) views.push_back(maker.make(i));
  for (size_t level = 0; level <= levels; ++level)
    views.push_back(view_level(static_cast<uint32_t>(level)));
  // A source of degenerate triangles alone is nothing to see, and may become nothing.
  const bool may_be_empty = topology.sides.empty();

  tbb::enumerable_thread_specific<EdgeCount> counts([&] { return EdgeCount(topology); });
  std::vector<CutResult> results(views.size());
  for (size_t begin = 0; begin < views.size(); begin += kBatch) {
    progress.report(0.7 + 0.3 * static_cast<double>(begin) / static_cast<double>(views.size()),
                    "checking cuts");
    parallel_for(std::min(kBatch, views.size() - begin), 1, [&](size_t i) {
      results[begin + i] = examine(tables, views[begin + i], counts.local());
    });
  }
  for (size_t i = 0; i < views.size(); ++i)
    name(topology, views[i], results[i], may_be_empty, findings);
  cuts = config.cuts;
}

}  // namespace umbel::lod
