// Three passes. The summaries of the parts tell the format and number the groups. Then the blocks
// are read, each group is encoded, and the chunks go to a temporary file in the order in which they
// come. With their sizes known, pages are planned, and written with chunks from there.
//
// Groups are numbered level by level, in each by unit, so a unit's groups of one level are
// consecutive: a few runs a unit say the number of any group.
#include "scale/finish.hpp"

#include <algorithm>
#include <limits>
#include <map>
#include <span>
#include <utility>

#include "asset/file/group_chunk.hpp"
#include "asset/file/write_encoded.hpp"
#include "base/file.hpp"
#include "base/math.hpp"
#include "base/parallel.hpp"
#include "lod/build/dag_writer.hpp"
#include "lod/build/hierarchy.hpp"
#include "scale/encode.hpp"
#include "scale/parts.hpp"
#include "scale/work_folder.hpp"

namespace umbel::scale {
namespace {

// What encoding takes of all work.
constexpr double kEncoding = 0.8;

std::vector<Run> runs_of(const PartsSummary& summary) {
  std::vector<Run> runs;
  for (uint32_t g = 0; g < summary.groups.size(); ++g) {
    const uint32_t level = summary.groups[g].level;
    if (runs.empty() || runs.back().level != level) runs.push_back({level, g, 0, 0});
    ++runs.back().count;
  }
  return runs;
}

class Finisher {
 public:
  Finisher(const FinishInput& input, const FinishOptions& options, Progress& progress)
      : input_(input), options_(options), progress_(progress), chunks_(options.work) {
    finished_.report = input.report;
    asset::check_contents(options.contents, options.asset, 1);
  }

  Finished run(OutputFile& file) {
    number_groups();
    describe_groups();
    encode_groups();
    AssetContents contents = options_.contents;
    if (options_.metadata) contents.metadata = options_.metadata(finished_);
    for (const std::filesystem::path& path : options_.files) {
      const InputFile input(path);
      input.read(0, contents.files.emplace_back(input.size()));
    }
    std::vector<asset::EncodedMesh> meshes;
    meshes.push_back(std::move(mesh_));
    finished_.bytes = asset::write_encoded(
        file, contents, std::move(meshes), options_.asset.page_bytes,
        [&](const asset::GroupName& name) { return read_chunk(name.group); }, progress_, kEncoding);
    return finished_;
  }

 private:
  // From the summaries: what there is, and which number each group gets.
  void number_groups() {
    asset::VertexStatistics vertices;
    uint32_t largest_material = 0;
    uint64_t groups = 0, clusters = 0;
    std::map<uint32_t, std::vector<uint32_t>> levels;  // runs
    for (uint32_t u = 0; u < input_.parts.size(); ++u) {
      const PartsSummary summary = read_summary(input_.parts[u]);
      asset::add(vertices, {summary.streams.at(0), summary.extras, summary.extra_ranges});
      largest_material = std::max(largest_material, summary.largest_material.at(0));
      extend(mesh_.mesh.bounds, summary.box.at(0));
      finished_.triangles += summary.triangles.at(0);
      plan_.first_run.push_back(static_cast<uint32_t>(plan_.runs.size()));
      for (const Run& run : runs_of(summary)) {
        levels[run.level].push_back(static_cast<uint32_t>(plan_.runs.size()));
        plan_.runs.push_back(run);
      }
      uint32_t first = 0;
      for (uint32_t b = 0; b < summary.blocks.size(); ++b) {
        blocks_.push_back({u, b, first, summary.blocks[b]});
        first += summary.blocks[b];
      }
      groups += summary.groups.size();
      for (const FinishedGroup& group : summary.groups) {
        clusters += group.clusters;
        lod::count_group(group.method, group.limiting_factor, finished_.report);
      }
    }
    plan_.first_run.push_back(static_cast<uint32_t>(plan_.runs.size()));
    if (groups >= kNone || clusters >= kNone)
      throw Error(ErrorCode::kUnsupported, "the levels of detail have " + std::to_string(groups) +
                                               " groups of " + std::to_string(clusters) +
                                               " clusters, but an asset can have 4294967294");
    uint32_t number = 0;
    for (const auto& [level, runs] : levels) {
      mesh_.levels.push_back({number, 0});
      for (const uint32_t run : runs) {
        plan_.runs[run].number = number;
        number += plan_.runs[run].count;
      }
      mesh_.levels.back().count = number - mesh_.levels.back().offset;
    }
    finished_.levels = static_cast<uint32_t>(levels.size());
    finished_.groups = mesh_.mesh.groups = static_cast<uint32_t>(groups);
    finished_.clusters = mesh_.mesh.clusters = static_cast<uint32_t>(clusters);
    choose_format(std::move(vertices), largest_material);
  }

  void choose_format(asset::VertexStatistics vertices, uint32_t largest_material) {
    has_materials_ = input_.config.mix_materials && largest_material > 0;
    if (has_materials_) {
      vertices.extras.push_back({ExtraKind::kMaterial, 0});
      vertices.extra_ranges.push_back({static_cast<float>(largest_material), 1});
    }
    mesh_.format = asset::choose_format(vertices, input_.config.position_step, options_.asset);
    mesh_.mesh.source_triangles = input_.report.input_triangles;
    mesh_.mesh.source_vertices = input_.report.input_vertices;
    mesh_.mesh.source_digest = input_.source_digest;
    mesh_.max_triangles = input_.config.max_triangles;
    mesh_.max_vertices = input_.config.max_vertices;
  }

  void describe_groups() {
    mesh_.groups.resize(finished_.groups);
    for (uint32_t u = 0; u < input_.parts.size(); ++u) {
      const PartsSummary summary = read_summary(input_.parts[u]);
      for (uint32_t g = 0; g < summary.groups.size(); ++g) {
        lod::Group& group = mesh_.groups[plan_.number_of(u, g)].group;
        group = group_of(summary.groups[g]);
        group.clusters.count = summary.groups[g].clusters;
      }
    }
    lod::Tables tables;
    tables.levels = mesh_.levels;
    tables.groups.reserve(mesh_.groups.size());
    uint32_t clusters = 0;
    for (uint32_t l = 0; l < mesh_.levels.size(); ++l)
      for (uint32_t i = 0; i < mesh_.levels[l].count; ++i) {
        lod::Group& group = mesh_.groups[mesh_.levels[l].offset + i].group;
        group.level = l;
        group.clusters.offset = clusters;
        clusters += group.clusters.count;
        tables.groups.push_back(group);
      }
    mesh_.nodes = lod::build_hierarchy(tables);
  }

  // The plan of encoding, with all that is known now.
  void make_plan() {
    plan_.attributes = mesh_.format.attributes;
    plan_.is_smooth = mesh_.format.is_smooth;
    plan_.bounds = {mesh_.mesh.bounds};
    plan_.first_material = {asset::first_material(options_.contents, 0)};
    plan_.has_materials = {has_materials_ ? 1u : 0u};
    for (uint32_t u = 0; u < input_.units.size(); ++u)
      if (input_.units[u].tier == plan_.first_serial.size()) plan_.first_serial.push_back(u);
  }

  void encode_groups() {
    make_plan();
    chunk_at_.resize(mesh_.groups.size());
    if (options_.run) return encode_elsewhere();
    const size_t threads = usable_threads();
    std::vector<EncodedBlock> made(threads == 1 ? 1 : 2 * threads);
    for (size_t begin = 0; begin < blocks_.size(); begin += made.size()) {
      report(static_cast<double>(begin) / static_cast<double>(blocks_.size()));
      const size_t count = std::min(made.size(), blocks_.size() - begin);
      parallel_for(count, 1, [&](size_t i) { made[i] = encode(blocks_[begin + i]); });
      for (size_t i = 0; i < count; ++i) keep(blocks_[begin + i], made[i]);
    }
  }

  void report(double part) { progress_.report(kEncoding * part, "writing"); }

  EncodedBlock encode(const BlockName& name) const {
    std::vector<uint32_t> clusters(name.groups);
    for (uint32_t i = 0; i < name.groups; ++i)
      clusters[i] = mesh_.groups[number_of(name, i)].group.clusters.count;
    return encode_block(plan_, name, input_.parts[name.serial], clusters);
  }

  // As tasks, a unit each. What an earlier build left by the same plan is taken.
  void encode_elsewhere() {
    const uint64_t plan = hash_of(plan_);
    write_encode_plan(encode_plan_file(options_.work, plan), plan_);
    std::vector<Task> tasks, missing;
    for (const Task& unit : input_.units) {
      tasks.push_back({unit.tier, unit.unit, TaskKind::kEncode, plan});
      if (!is_whole(chunks_file(options_.work, tasks.back()))) missing.push_back(tasks.back());
    }
    options_.run(missing, [&](size_t done) {
      report(static_cast<double>(tasks.size() - missing.size() + done) /
             static_cast<double>(tasks.size()));
    });
    for (const BlockName& name : blocks_)
      keep(name, read_encoded(chunks_file(options_.work, tasks[name.serial]), name.block));
  }

  uint32_t number_of(const BlockName& name, uint32_t group) const {
    return plan_.number_of(name.serial, name.first_group + group);
  }

  void keep(const BlockName& name, const EncodedBlock& made) {
    if (made.chunk_bytes.size() != name.groups || made.references.size() != name.groups)
      corrupt("a block of chunks has other groups than its unit");
    uint64_t at = chunks_.size();
    chunks_.append(made.bytes);
    std::span<const std::byte> rest = made.bytes;
    for (uint32_t i = 0; i < name.groups; ++i) {
      const uint32_t number = number_of(name, i);
      asset::GroupEntry& entry = mesh_.groups[number];
      entry.references = made.references[i];
      entry.chunk_bytes = made.chunk_bytes[i];
      for (uint32_t r = 0; r < entry.references; ++r)
        ++mesh_.groups[asset::referred_group(rest, r)].parents;
      rest = rest.subspan(entry.chunk_bytes);
      chunk_at_[number] = {at, entry.chunk_bytes};
      at += entry.chunk_bytes;
    }
  }

  std::vector<std::byte> read_chunk(uint32_t group) const {
    std::vector<std::byte> chunk(chunk_at_[group].bytes);
    chunks_.read(chunk_at_[group].at, chunk);
    return chunk;
  }

  struct ChunkPlace {
    uint64_t at;
    uint64_t bytes;
  };

  const FinishInput& input_;
  const FinishOptions& options_;
  Progress& progress_;
  Finished finished_;
  asset::EncodedMesh mesh_;
  bool has_materials_ = false;  // vertices have them, since clusters mix them
  EncodePlan plan_;
  std::vector<BlockName> blocks_;
  TemporaryFile chunks_;
  std::vector<ChunkPlace> chunk_at_;  // by group
};

}  // namespace

Finished finish(const std::filesystem::path& path, const FinishInput& input,
                const FinishOptions& options, const BuildOptions& build) {
  Progress progress(build);
  OutputFile file(path);
  Finished finished;
  with_threads(build.threads, [&] { finished = Finisher(input, options, progress).run(file); });
  file.commit();
  return finished;
}

}  // namespace umbel::scale
