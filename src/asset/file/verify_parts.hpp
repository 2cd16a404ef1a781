// What both ways to verify an asset share: how reports are made, and what a mesh claims.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "umbel/asset.hpp"

namespace umbel::asset {

inline constexpr size_t kMaxProblems = 32;

inline void add_checksum_error(lod::VerifyReport& report, const std::string& sentence) {
  report.ok = false;
  ++report.checksum_errors;
  if (report.problems.size() < kMaxProblems) report.problems.push_back(sentence);
}

inline void add(lod::VerifyReport& report, const lod::VerifyReport& more) {
  report.ok &= more.ok;
  report.cuts += more.cuts;
  report.cracks += more.cracks;
  report.overlaps += more.overlaps;
  report.limit_violations += more.limit_violations;
  report.monotone &= more.monotone;
  for (const std::string& problem : more.problems)
    if (report.problems.size() < kMaxProblems) report.problems.push_back(problem);
}

inline lod::VerifyConfig verify_config(const AssetInfo& info, const AssetMesh& mesh, uint32_t cuts,
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

/// Reads all of a tree of instances. Throws kCorrupt.
void check_instances(const Asset& asset);

inline bool is_damage(const Error& error) {
  return error.code() == ErrorCode::kCorrupt || error.code() == ErrorCode::kUnsupported;
}

/// Runs work(report); damage that it throws is a finding.
template <typename Work>
lod::VerifyReport with_report(const Work& work) {
  lod::VerifyReport report;
  try {
    work(report);
  } catch (const Error& error) {
    if (!is_damage(error)) throw;
    add_checksum_error(report, error.what());
  }
  return report;
}

/// Opens a file and runs work(asset); one that is no asset is a finding.
template <typename Work>
lod::VerifyReport verify_file(const std::filesystem::path& path, const Work& work) {
  std::optional<Asset> asset;
  const lod::VerifyReport opening = with_report([&](lod::VerifyReport&) { asset.emplace(path); });
  return asset ? work(*asset) : opening;
}

}  // namespace umbel::asset
