// Everything about an asset that can be checked: that it opens, that every page is what its
// checksum says, and then what lod::verify proves.
#include <atomic>

#include "base/parallel.hpp"
#include "base/progress.hpp"
#include "umbel/asset.hpp"

namespace umbel {
namespace {

constexpr size_t kMaxProblems = 32;

void add_checksum_error(lod::VerifyReport& report, const std::string& sentence) {
  report.ok = false;
  ++report.checksum_errors;
  if (report.problems.size() < kMaxProblems) report.problems.push_back(sentence);
}

/// A page that has become unreadable counts as one that is not whole.
std::vector<uint8_t> broken_pages(const Asset& asset, const BuildOptions& options) {
  std::vector<uint8_t> broken(asset.tables().groups.size());
  with_threads(options.threads, [&] {
    parallel_for(broken.size(), 16, [&](size_t group) {
      try {
        broken[group] = !asset.page_is_whole(static_cast<uint32_t>(group));
      } catch (const Error&) {
        broken[group] = true;
      }
    });
  });
  return broken;
}

lod::VerifyConfig config_of(const AssetInfo& info, uint32_t cuts, uint32_t seed) {
  lod::VerifyConfig config;
  config.cuts = cuts;
  config.seed = seed;
  config.max_triangles = info.max_triangles;
  config.max_vertices = info.max_vertices;
  config.source_triangles = info.source_triangles;
  config.source_digest = info.source_digest;
  return config;
}

}  // namespace

lod::VerifyReport verify_asset(const std::filesystem::path& path, uint32_t cuts, uint32_t seed,
                               const BuildOptions& options) {
  lod::VerifyReport report;
  try {
    const Asset asset(path);
    const std::vector<uint8_t> broken = broken_pages(asset, options);
    for (size_t group = 0; group < broken.size(); ++group)
      if (broken[group])
        add_checksum_error(report, "the checksum of the page of group " + std::to_string(group) +
                                       " does not hold");
    // Geometry that is known to be damaged would only add its consequences to the causes.
    if (!report.ok) return report;
    return lod::verify(
        asset.tables(), [&](uint32_t cluster) { return asset.geometry(cluster); },
        config_of(asset.info(), cuts, seed), options);
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kCorrupt && error.code() != ErrorCode::kUnsupported) throw;
    add_checksum_error(report, error.what());
  }
  return report;
}

}  // namespace umbel
