// Verifies an asset of any size in a fixed memory. The stages are those of lod::verify, with the
// same checks of the same clusters, but geometry is read page by page:
//
// 1. All pages in order: checksums, and the tables of groups, which stay. Levels, links, the
//    hierarchy, rising errors and spheres.
// 2. All pages in order: each cluster by itself, the digest of level 0, and how many triangles are
//    at each of its edges. Where a table of those edges is too large, only a part of them is
//    counted at a time, and the groups that level 0 is in are read once for each part.
// 3. All pages in order: each group beside what it was simplified to, which is in groups of pages
//    before; of these the ones used last are kept. Two forms with the same border make all cuts
//    right at once: see lod/verify/verify_borders.cpp.
// 4. Random cuts, each in the window around one group, of which all edges are counted that lie
//    wholly inside.
#include "asset/file/verify_paged.hpp"

#include <algorithm>
#include <deque>
#include <functional>
#include <limits>
#include <optional>

#include "asset/file/decoded_pages.hpp"
#include "asset/file/verify_parts.hpp"
#include "base/math.hpp"
#include "base/parallel.hpp"
#include "lod/verify/cluster_check.hpp"
#include "lod/verify/verify_borders.hpp"
#include "lod/verify/verify_cuts.hpp"
#include "lod/verify/verify_tables.hpp"
#include "lod/verify/view_maker.hpp"

namespace umbel::asset {
namespace {

using lod::number;

constexpr uint64_t kWorkingBytes = uint64_t{32} << 20;

/// A group beside what it was simplified to, in numbers of one topology.
struct Forms {
  lod::Topology topology;
  std::vector<uint32_t> own, simplified;  // of the topology
  std::vector<uint32_t> numbers;          // of the simplified ones in the mesh's tables

  lod::GroupForms view() const { return {own, simplified}; }
};

class PagedVerifier {
 public:
  PagedVerifier(const Asset& asset, uint64_t memory, uint32_t cuts, uint32_t seed,
                std::vector<GroupTables>& tables, Progress& progress)
      : asset_(asset), progress_(progress), memory_(memory), pages_(asset, memory / 4) {
    for (uint32_t m = 0; m < tables.size(); ++m)
      meshes_.emplace_back(m, tables[m],
                           verify_config(asset.info(), asset.meshes()[m], cuts, seed));
  }

  void run(lod::VerifyReport& report) {
    for (VerifiedMesh& mesh : meshes_) verify_tables(mesh);
    if (all([](const VerifiedMesh& mesh) { return mesh.links_hold; })) verify_geometry();
    for (const VerifiedMesh& mesh : meshes_) add(report, mesh.report);
  }

 private:
  template <typename Holds>
  bool all(const Holds& holds) const {
    return std::all_of(meshes_.begin(), meshes_.end(), holds);
  }

  // ---- tables

  void verify_tables(VerifiedMesh& mesh) {
    const lod::Tables& tables = mesh.groups.tables;
    mesh.links_hold =
        lod::verify_links_but_clusters(tables, asset_.meshes()[mesh.index].clusters, mesh.findings);
    if (!mesh.links_hold) {
      mesh.findings.other([] {
        return std::string(
            "Neither geometry nor cuts were checked, because the tables do not fit together");
      });
      return;
    }
    mesh.findings.begin_stage();
    for (uint32_t g = 0; g < tables.groups.size(); ++g)
      for (const uint32_t parent : mesh.groups.parents_of(g)) {
        lod::verify_origin(tables, parent, g, "A cluster of group " + number(parent),
                           mesh.findings);
        lod::verify_rise(tables, parent, g, mesh.findings);
      }
    lod::verify_nodes(tables, mesh.findings);
    const auto is_root = [](const lod::Group& group) {
      return group.error == std::numeric_limits<float>::infinity();
    };
    if (!tables.groups.empty() && std::none_of(tables.groups.begin(), tables.groups.end(), is_root))
      mesh.findings.other([] {
        return std::string(
            "The coarsest cut is empty, though the source is not: no group is a root");
      });
  }

  // ---- geometry

  void verify_geometry() {
    for (VerifiedMesh& mesh : meshes_) mesh.findings.begin_stage();
    read_source(asset_, meshes_, memory_, progress_);
    for (VerifiedMesh& mesh : meshes_) {
      mesh.findings.begin_stage();
      if (mesh.complete)
        lod::verify_source(
            mesh.source_triangles, [&] { return mesh.source_digest; }, mesh.config, mesh.findings);
      else
        mesh.findings.other([] {
          return std::string(
              "Neither borders nor cuts were checked, because some clusters could not be read");
        });
    }
    if (!all([](const VerifiedMesh& mesh) { return mesh.complete; })) return;
    join_new_edges();
    for (VerifiedMesh& mesh : meshes_) mesh.findings.begin_stage();
    verify_borders();
    for (VerifiedMesh& mesh : meshes_) {
      mesh.findings.begin_stage();
      verify_windows(mesh);
    }
  }

  // ---- groups beside what they were simplified to

  /// A group, and what work says of it.
  struct Job {
    VerifiedMesh* mesh;
    uint32_t group;
    lod::VerifyReport report;
    std::vector<std::pair<uint64_t, uint64_t>> joined;
  };

  /// Calls work(job, forms) for all groups that are wanted, many at once, with their pages and
  /// those of what they were simplified to, then finish(job) one after the other in the file's
  /// order.
  template <typename Wanted, typename Work, typename Finish>
  void for_each_group(const Wanted& wanted, const Work& work, const Finish& finish) {
    std::vector<uint32_t> needed;
    const std::vector<bool> has_wanted = pages_with(asset_, meshes_, wanted);
    std::vector<std::vector<std::pair<uint32_t, uint32_t>>> order = groups_by_page(wanted);
    for (uint32_t begin = 0; begin < has_wanted.size(); begin += kPagesAtOnce) {
      std::vector<Job> jobs;
      needed.clear();
      for (uint32_t p = begin; p < std::min<size_t>(begin + kPagesAtOnce, has_wanted.size()); ++p) {
        if (!has_wanted[p]) continue;
        needed.push_back(p);
        for (const auto& [m, g] : order[p]) {
          jobs.push_back({&meshes_[m], g, {}, {}});
          for (const uint32_t parent : meshes_[m].groups.parents_of(g))
            needed.push_back(meshes_[m].groups.pages[parent]);
        }
      }
      std::sort(needed.begin(), needed.end());
      needed.erase(std::unique(needed.begin(), needed.end()), needed.end());
      pages_.load(needed);
      parallel_for(jobs.size(), 1, [&](size_t i) { work(jobs[i], forms_of(jobs[i])); });
      for (Job& job : jobs) finish(job);
      progress_.report(0.5 + 0.4 * begin / double(has_wanted.size()), "checking borders");
    }
  }

  template <typename Wanted>
  std::vector<std::vector<std::pair<uint32_t, uint32_t>>> groups_by_page(
      const Wanted& wanted) const {
    std::vector<std::vector<std::pair<uint32_t, uint32_t>>> order(asset_.info().pages);
    for (const VerifiedMesh& mesh : meshes_)
      for (uint32_t g = 0; g < mesh.groups.pages.size(); ++g)
        if (wanted(mesh, g)) order[mesh.groups.pages[g]].push_back({mesh.index, g});
    return order;
  }

  Forms forms_of(const Job& job) const {
    const GroupTables& groups = job.mesh->groups;
    Forms forms;
    lod::TopologyBuilder builder;
    uint32_t next = 0;
    const DecodedPage& page = pages_.at(groups.pages[job.group]);
    for (const lod::ClusterGeometry& cluster :
         page.geometry[page.find(job.mesh->index, job.group)]) {
      builder.add(cluster);
      forms.own.push_back(next++);
    }
    for (const uint32_t parent : groups.parents_of(job.group)) {
      const DecodedPage& above = pages_.at(groups.pages[parent]);
      const uint32_t at = above.find(job.mesh->index, parent);
      const PageGroup& group = above.groups[at];
      for (uint32_t c = 0; c < group.clusters.size(); ++c) {
        if (group.clusters[c].generating_group != job.group) continue;
        builder.add(above.geometry[at][c]);
        forms.simplified.push_back(next++);
        forms.numbers.push_back(group.group.clusters.offset + c);
      }
    }
    forms.topology = builder.take();
    return forms;
  }

  /// Edges between new positions of what groups were simplified to with enlarged components.
  void join_new_edges() {
    for_each_group(
        [](const VerifiedMesh& mesh, uint32_t g) {
          return mesh.method(g) == lod::SimplifyMethod::kSloppy;
        },
        [](Job& job, const Forms& forms) {
          const lod::Topology& topology = forms.topology;
          std::vector<bool> is_old(topology.positions.size());
          for (const uint32_t c : forms.own)
            for (const uint32_t p : topology.positions_of(c)) is_old[p] = true;
          const auto ends = [&](uint32_t e) {
            return std::pair(topology.edges[e] >> 32, topology.edges[e] & 0xffffffffu);
          };
          lod::for_each_irregular(
              topology, forms.simplified,
              [&](uint32_t e) { return !is_old[ends(e).first] && !is_old[ends(e).second]; },
              [&](uint32_t e) {
                job.joined.push_back({job.mesh->hash(topology.positions[ends(e).first]),
                                      job.mesh->hash(topology.positions[ends(e).second])});
              });
        },
        [](Job& job) {
          for (const auto& [a, b] : job.joined) job.mesh->joined.join(a, b);
        });
  }

  void verify_borders() {
    for_each_group([](const VerifiedMesh&, uint32_t) { return true; },
                   [](Job& job, Forms&& forms) {
                     allow_edges(*job.mesh, forms.topology);
                     const lod::Group& group = job.mesh->groups.tables.groups[job.group];
                     lod::Findings findings(job.report);
                     const lod::BorderResult result = lod::compare_forms(
                         forms.topology, forms.view(), group.method == lod::SimplifyMethod::kRoot);
                     lod::name_border(forms.topology, job.group, group, result, findings);
                     lod::PositionMarks marks(forms.topology.positions.size());
                     lod::verify_new_positions(forms.topology, job.group, group.sphere,
                                               forms.view(), forms.numbers, marks, findings);
                   },
                   [](Job& job) { job.mesh->findings.absorb(job.report); });
  }

  static void allow_edges(const VerifiedMesh& mesh, lod::Topology& topology) {
    topology.oriented = mesh.oriented;
    topology.allowed.assign(topology.edges.size(), 0);
    if (mesh.joined.empty()) return;
    std::vector<uint64_t> ids;
    for (const Vec3& p : topology.positions) ids.push_back(mesh.hash(p));
    for (size_t e = 0; e < topology.edges.size(); ++e)
      topology.allowed[e] = mesh.joined.are_joined(ids[topology.edges[e] >> 32],
                                                   ids[topology.edges[e] & 0xffffffffu]);
  }

  // ---- cuts

  void verify_windows(VerifiedMesh& mesh) {
    const lod::Tables& tables = mesh.groups.tables;
    mesh.report.cuts = mesh.config.cuts;
    if (tables.groups.empty()) return;
    lod::ViewMaker maker(tables.groups, asset_.meshes()[mesh.index].bounds, mesh.config.seed);
    const uint32_t levels = static_cast<uint32_t>(std::min<size_t>(tables.levels.size(), 64));
    const uint32_t count = mesh.config.cuts + levels;
    for (uint32_t i = 0; i < count; ++i) {
      progress_.report(0.9 + 0.1 * i / count, "checking cuts");
      const lod::View view =
          i < mesh.config.cuts ? maker.make(i) : lod::view_level(i - mesh.config.cuts);
      const Sphere& around = tables.groups[maker.random().next() % tables.groups.size()].sphere;
      verify_window(mesh, view, around);
    }
  }

  /// Of the cut, what lies in the box around half of a sphere.
  void verify_window(VerifiedMesh& mesh, const lod::View& view, const Sphere& around) {
    const float reach = 0.5f * around.radius, more = 0.51f * around.radius;
    const float x[3] = {around.center.x, around.center.y, around.center.z};
    std::vector<Plane> planes;
    Vec3 low{}, high{};
    for (int axis = 0; axis < 3; ++axis) {
      Vec3 normal{axis == 0 ? 1.0f : 0.0f, axis == 1 ? 1.0f : 0.0f, axis == 2 ? 1.0f : 0.0f};
      planes.push_back({normal, -(x[axis] - more)});
      planes.push_back({-1.0f * normal, x[axis] + more});
      (axis == 0 ? low.x : axis == 1 ? low.y : low.z) = x[axis] - reach;
      (axis == 0 ? high.x : axis == 1 ? high.y : high.z) = x[axis] + reach;
    }
    lod::TopologyBuilder builder;
    std::vector<uint32_t> numbers;
    asset_.walk(
        view,
        [&](const CutGroup& found) {
          const std::vector<lod::ClusterGeometry> all = asset_.decode(found.page, found.index);
          for (const uint32_t c : found.clusters) {
            builder.add(all[c]);
            numbers.push_back(found.page.groups[found.index].group.clusters.offset + c);
          }
        },
        mesh.index, planes);
    lod::Topology topology = builder.take();
    allow_edges(mesh, topology);
    const auto is_inside = [&](uint64_t p) {
      const Vec3& at = topology.positions[p];
      return at.x >= low.x && at.y >= low.y && at.z >= low.z && at.x <= high.x && at.y <= high.y &&
             at.z <= high.z;
    };
    for (size_t e = 0; e < topology.edges.size(); ++e)
      if (!is_inside(topology.edges[e] >> 32) || !is_inside(topology.edges[e] & 0xffffffffu))
        topology.allowed[e] = 1;
    lod::verify_part_of_cut(topology, numbers, view, mesh.findings);
  }

  const Asset& asset_;
  Progress& progress_;
  uint64_t memory_;
  DecodedPages pages_;
  std::deque<VerifiedMesh> meshes_;
};

void verify_all(const Asset& asset, uint64_t memory, uint32_t cuts, uint32_t seed,
                Progress& progress, lod::VerifyReport& report) {
  const uint64_t tables = group_table_bytes(asset) + kWorkingBytes;
  if (tables + kWorkingBytes > memory)
    throw Error(ErrorCode::kInvalidArgument,
                "verifying this asset takes at least " +
                    std::to_string((tables + 2 * kWorkingBytes) / 1'000'000 + 1) +
                    " MB, more than the " + std::to_string(memory / 1'000'000) + " MB given");
  if (!asset.header_is_whole())
    add_checksum_error(report, "the checksum of the tables does not hold");
  for (uint32_t file = 0; file < asset.files(); ++file) asset.file(file);
  check_instances(asset);
  std::vector<std::string> broken;
  std::vector<GroupTables> groups = read_group_tables(asset, progress, 0.1, broken);
  for (const std::string& sentence : broken) add_checksum_error(report, sentence);
  // Errors in damaged pages' geometry would only repeat the cause.
  if (!report.ok) return;
  PagedVerifier(asset, memory - tables, cuts, seed, groups, progress).run(report);
  progress.report(1.0, "verified");
}

}  // namespace
}  // namespace umbel::asset

namespace umbel {

lod::VerifyReport verify_asset_within(uint64_t memory_bytes, const Asset& asset, uint32_t cuts,
                                      uint32_t seed, const BuildOptions& options) {
  Progress progress(options);
  return asset::with_report([&](lod::VerifyReport& report) {
    with_threads(options.threads,
                 [&] { asset::verify_all(asset, memory_bytes, cuts, seed, progress, report); });
  });
}

lod::VerifyReport verify_asset_within(uint64_t memory_bytes, const std::filesystem::path& path,
                                      uint32_t cuts, uint32_t seed, const BuildOptions& options) {
  return asset::verify_file(path, [&](const Asset& asset) {
    return verify_asset_within(memory_bytes, asset, cuts, seed, options);
  });
}

}  // namespace umbel
