// Verifies a DAG: tables first, then every cluster by itself, then what groups were simplified to,
// then cuts. A stage is left out if it needs what an earlier one found broken, and the report says
// so.
#include "base/parallel.hpp"
#include "lod/verify/verify_borders.hpp"
#include "lod/verify/verify_cuts.hpp"
#include "lod/verify/verify_geometry.hpp"
#include "lod/verify/verify_tables.hpp"

namespace umbel::lod {
namespace {

void verify_all(const Tables& tables, const GeometryReader& geometry, const VerifyConfig& config,
                const BuildOptions& options, VerifyReport& report) {
  Progress progress(options);
  Findings findings(report);
  progress.report(0.0, "checking tables");
  if (!verify_links(tables, findings)) {
    findings.other([] {
      return std::string(
          "Neither geometry nor cuts were checked, because the tables do not fit "
          "together");
    });
    return;
  }
  verify_monotone(tables, findings);
  const Topology topology = read_topology(tables, geometry, config, findings, progress);
  if (!topology.complete) {
    findings.other([] {
      return std::string(
          "Neither borders nor cuts were checked, because some clusters could not "
          "be read");
    });
    return;
  }
  progress.report(0.6, "checking borders");
  verify_borders(tables, topology, findings);
  verify_cuts(tables, topology, config, report.cuts, findings, progress);
  progress.report(1.0, "verified");
}

}  // namespace

VerifyReport verify(const Tables& tables, const GeometryReader& geometry,
                    const VerifyConfig& config, const BuildOptions& options) {
  if (!geometry) throw Error(ErrorCode::kInvalidArgument, "verify: the geometry reader is empty");
  VerifyReport report;
  with_threads(options.threads, [&] { verify_all(tables, geometry, config, options, report); });
  return report;
}

}  // namespace umbel::lod
