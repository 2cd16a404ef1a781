// Verification of cuts: random ones, half by error and half by camera from inside and outside the
// mesh, and one a level. Each is selected in both ways and its triangles are counted edge by edge.
#include "lod/verify/verify_cuts.hpp"

#include <tbb/enumerable_thread_specific.h>

#include <algorithm>
#include <numeric>

#include "base/parallel.hpp"
#include "lod/verify/edge_count.hpp"
#include "lod/verify/view_maker.hpp"

namespace umbel::lod {
namespace {

constexpr size_t kKept = 3;
constexpr size_t kMostLevels = 64;  // far more than halving ever makes

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

void count_edges(EdgeCount& edges, std::span<const uint32_t> cut, CutResult& result) {
  edges.count(cut, [&](const BadEdge& bad) {
    const bool crack = bad.triangles < 2;
    ++(crack ? result.cracks : result.overlaps);
    auto& kept = crack ? result.first_cracks : result.first_overlaps;
    if (kept.size() < kKept) kept.push_back(bad);
  });
}

CutResult examine(const Tables& tables, const View& view, EdgeCount& edges) {
  const std::vector<uint32_t> cut = select(tables, view);
  CutResult result;
  result.same = cut == select_hierarchy(tables, view);
  result.empty = cut.empty();
  count_edges(edges, cut, result);
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

void verify_part_of_cut(const Topology& topology, std::span<const uint32_t> numbers,
                        const View& view, Findings& findings) {
  std::vector<uint32_t> all(numbers.size());
  std::iota(all.begin(), all.end(), 0u);
  EdgeCount edges(topology);
  CutResult result;
  count_edges(edges, all, result);
  for (auto* kept : {&result.first_cracks, &result.first_overlaps})
    for (BadEdge& bad : *kept) bad.cluster = numbers[bad.cluster];
  name(topology, view, result, true, findings);
}

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
  Aabb box;
  for (const Cluster& cluster : tables.clusters) extend(box, cluster.box);
  ViewMaker maker(tables.groups, box, config.seed);
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
