// Checks all of an asset: that it opens, that every checksum holds, and then what lod::verify
// checks.
#include "asset/file/verify_parts.hpp"
#include "base/parallel.hpp"

namespace umbel {
namespace {

/// Pages whose checksum or entry in the table does not hold. Throws where one cannot be read.
std::vector<uint8_t> broken_pages(const Asset& asset, const BuildOptions& options) {
  std::vector<uint8_t> broken(asset.info().pages);
  with_threads(options.threads, [&] {
    parallel_for(broken.size(), 16, [&](size_t page) {
      try {
        broken[page] = !asset.page_is_whole(static_cast<uint32_t>(page));
      } catch (const Error& error) {
        if (!asset::is_damage(error)) throw;
        broken[page] = true;
      }
    });
  });
  return broken;
}

}  // namespace

void asset::check_instances(const Asset& asset) {
  if (!asset.has_instance_tree()) return;
  for (uint32_t n = 0; n < asset.instance_nodes().size(); ++n) asset.placements(n);
}

lod::VerifyReport verify_asset(const Asset& asset, uint32_t cuts, uint32_t seed,
                               const BuildOptions& options) {
  return asset::with_report([&](lod::VerifyReport& report) {
    const std::vector<uint8_t> broken = broken_pages(asset, options);
    for (size_t page = 0; page < broken.size(); ++page)
      if (broken[page])
        asset::add_checksum_error(
            report, "the checksum of page " + std::to_string(page) + " does not hold");
    if (!asset.header_is_whole())
      asset::add_checksum_error(report, "the checksum of the tables does not hold");
    for (uint32_t file = 0; file < asset.files(); ++file) asset.file(file);
    asset::check_instances(asset);
    // Errors in damaged pages' geometry would only repeat the cause.
    if (!report.ok) return;
    for (uint32_t m = 0; m < asset.meshes().size(); ++m)
      asset::add(report,
                 lod::verify(
                     asset.tables(m), [&](uint32_t cluster) { return asset.geometry(cluster, m); },
                     asset::verify_config(asset.info(), asset.meshes()[m], cuts, seed), options));
  });
}

lod::VerifyReport verify_asset(const std::filesystem::path& path, uint32_t cuts, uint32_t seed,
                               const BuildOptions& options) {
  return asset::verify_file(
      path, [&](const Asset& asset) { return verify_asset(asset, cuts, seed, options); });
}

}  // namespace umbel
