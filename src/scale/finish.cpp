#include "scale/finish.hpp"

#include "scale/join_parts.hpp"

namespace umbel::scale {

Finished finish(const std::filesystem::path& path, const FinishInput& input,
                const FinishOptions& options, const BuildOptions& build) {
  lod::Dag dag;
  dag.config = input.config;
  dag.report = input.report;
  dag.source_digest = input.source_digest;
  join_parts(input.parts, dag);
  Finished finished;
  finished.report = dag.report;
  finished.levels = static_cast<uint32_t>(dag.tables.levels.size());
  finished.groups = static_cast<uint32_t>(dag.tables.groups.size());
  finished.clusters = static_cast<uint32_t>(dag.tables.clusters.size());
  finished.triangles = dag.cluster_triangles.size() / 3;
  AssetContents contents = options.contents;
  contents.meshes = {&dag};
  if (options.metadata) contents.metadata = options.metadata(finished);
  finished.bytes = write_asset(path, contents, build, options.asset);
  return finished;
}

}  // namespace umbel::scale
