// Checks all of an asset: that it opens, that every checksum holds, and then what lod::verify
// checks.
#include <optional>

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

/// Pages that are unreadable or whose checksum does not hold.
std::vector<uint8_t> broken_pages(const Asset& asset, const BuildOptions& options) {
  std::vector<uint8_t> broken(asset.info().pages);
  with_threads(options.threads, [&] {
    parallel_for(broken.size(), 16, [&](size_t page) {
      try {
        broken[page] = !asset.page_is_whole(static_cast<uint32_t>(page));
      } catch (const Error&) {
        broken[page] = true;
      }
    });
  });
  return broken;
}

lod::VerifyConfig config_of(const AssetInfo& info, const AssetMesh& mesh, uint32_t cuts,
                            uint32_t seed) {
  lod::VerifyConfig config;
  config.cuts = cuts;
  config.seed = seed;
  config.max_triangles = info.max_triangles;
  config.max_vertices = info.max_vertices;
  config.source_triangles = mesh.source_triangles;
  config.source_digest = mesh.source_digest;
  return config;
}

void add(lod::VerifyReport& report, const lod::VerifyReport& more) {
  report.ok &= more.ok;
  report.cuts += more.cuts;
  report.cracks += more.cracks;
  report.overlaps += more.overlaps;
  report.limit_violations += more.limit_violations;
  report.monotone &= more.monotone;
  for (const std::string& problem : more.problems)
    if (report.problems.size() < kMaxProblems) report.problems.push_back(problem);
}

}  // namespace

lod::VerifyReport verify_asset(const Asset& asset, uint32_t cuts, uint32_t seed,
                               const BuildOptions& options) {
  lod::VerifyReport report;
  try {
    const std::vector<uint8_t> broken = broken_pages(asset, options);
    for (size_t page = 0; page < broken.size(); ++page)
      if (broken[page])
        add_checksum_error(report,
                           "the checksum of page " + std::to_string(page) + " does not hold");
    for (uint32_t file = 0; file < asset.files(); ++file) asset.file(file);
    // Errors in damaged pages' geometry would only repeat the cause.
    if (!report.ok) return report;
    for (uint32_t m = 0; m < asset.meshes().size(); ++m)
      add(report, lod::verify(
                      asset.tables(m), [&](uint32_t cluster) { return asset.geometry(cluster, m); },
                      config_of(asset.info(), asset.meshes()[m], cuts, seed), options));
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kCorrupt && error.code() != ErrorCode::kUnsupported) throw;
    add_checksum_error(report, error.what());
  }
  return report;
}

lod::VerifyReport verify_asset(const std::filesystem::path& path, uint32_t cuts, uint32_t seed,
                               const BuildOptions& options) {
  std::optional<Asset> asset;
  try {
    asset.emplace(path);
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kCorrupt && error.code() != ErrorCode::kUnsupported) throw;
    lod::VerifyReport report;
    add_checksum_error(report, error.what());
    return report;
  }
  return verify_asset(*asset, cuts, seed, options);
}

}  // namespace umbel
