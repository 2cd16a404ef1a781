// The first reading of all geometry: each cluster by itself, and the edges of level 0.
#include <algorithm>
#include <array>

#include "asset/file/decoded_pages.hpp"
#include "asset/file/verify_paged.hpp"
#include "base/parallel.hpp"
#include "lod/verify/cluster_check.hpp"

namespace umbel::asset {
namespace {

class SourceReader {
 public:
  SourceReader(const Asset& asset, std::deque<VerifiedMesh>& meshes, uint64_t memory,
               Progress& progress)
      : asset_(asset), meshes_(meshes), memory_(memory), progress_(progress) {}

  /// Every cluster by itself, and the edges of level 0, in as many parts as memory asks for.
  void run() {
    uint64_t triangles = 0;
    for (const VerifiedMesh& mesh : meshes_) triangles += mesh.groups.source_triangles;
    // Of a closed surface; where there are more edges, the table turns out too small.
    const uint64_t edges = triangles + triangles / 2 + 1024;
    const uint64_t most = std::max<uint64_t>(memory_ / 3 / lod::EdgeTable::kEntryBytes, 1 << 16);
    bool is_first = true;
    for (uint64_t parts = (edges + most - 1) / most;; parts *= 2) {
      // Entries for each triangle.
      const double room = double(std::min(most, 2 * edges)) / double(triangles + 1);
      bool fits = true;
      for (uint32_t part = 0; part < parts && fits; ++part) {
        fits = count_edges(room, part, static_cast<uint32_t>(parts), is_first);
        is_first = false;
      }
      if (fits) return;
      for (VerifiedMesh& mesh : meshes_) {
        mesh.joined = {};
        mesh.oriented = true;
      }
    }
  }

 private:
  /// Edges of different meshes never meet: each mesh has a table of its own. False if one is full.
  bool count_edges(double room, uint32_t part, uint32_t parts, bool is_first) {
    std::deque<lod::EdgeTable> tables;
    for (const VerifiedMesh& mesh : meshes_)
      tables.emplace_back(64 + static_cast<size_t>(room * double(mesh.groups.source_triangles)),
                          part, parts);
    bool fits = true;
    const auto wanted = [&](const VerifiedMesh& mesh, uint32_t group) {
      return is_first || mesh.groups.has_source[group];
    };
    for_each_page(wanted, is_first, "reading clusters", [&](const DecodedPage& page, size_t i) {
      const PageGroup& group = page.groups[i];
      VerifiedMesh& mesh = meshes_[group.mesh];
      for (size_t c = 0; c < page.geometry[i].size(); ++c)
        if (group.clusters[c].generating_group == kNone)
          fits &= add_source(mesh, page.geometry[i][c], is_first, tables[group.mesh]);
    });
    for (size_t m = 0; m < meshes_.size() && fits; ++m)
      tables[m].for_each([&](uint64_t a, uint64_t b, uint32_t forward, uint32_t backward) {
        if (forward == 1 && backward == 1) return;
        meshes_[m].oriented &= forward + backward != 2;
        meshes_[m].joined.join(a, b);
      });
    return fits;
  }

  bool add_source(VerifiedMesh& mesh, const lod::ClusterGeometry& cluster, bool is_first,
                  lod::EdgeTable& edges) {
    std::array<uint64_t, 256> ids;
    if (!is_usable(cluster)) return true;
    for (size_t v = 0; v < cluster.positions.size(); ++v) ids[v] = mesh.hash(cluster.positions[v]);
    std::vector<Triangle> triangles;
    bool fits = true;
    for (size_t t = 0; t + 2 < cluster.triangles.size(); t += 3) {
      const uint8_t a = cluster.triangles[t], b = cluster.triangles[t + 1],
                    c = cluster.triangles[t + 2];
      triangles.push_back({a, b, c});
      if (ids[a] == ids[b] || ids[b] == ids[c] || ids[c] == ids[a]) continue;
      fits &= edges.add(ids[a], ids[b]) && edges.add(ids[b], ids[c]) && edges.add(ids[c], ids[a]);
    }
    if (is_first) {
      MeshView view;
      view.positions = cluster.positions;
      view.triangles = triangles;
      mesh.source_triangles += triangles.size();
      mesh.source_digest += triangle_set_digest(view);
    }
    return fits;
  }

  static bool is_usable(const lod::ClusterGeometry& cluster) {
    return cluster.positions.size() <= 256 &&
           std::all_of(cluster.triangles.begin(), cluster.triangles.end(),
                       [&](uint8_t v) { return v < cluster.positions.size(); });
  }

  /// Reads pages in order, and calls visit(page, i) for groups that are wanted.
  template <typename Wanted, typename Visit>
  void for_each_page(const Wanted& wanted, bool checks, const char* stage, const Visit& visit) {
    const uint32_t count = asset_.info().pages;
    std::vector<bool> has_wanted = pages_with(asset_, meshes_, wanted);
    std::vector<uint32_t> batch;
    for (uint32_t p = 0; p < count; ++p) {
      if (has_wanted[p]) batch.push_back(p);
      if (batch.size() < kPagesAtOnce && p + 1 < count) continue;
      progress_.report(0.1 + 0.4 * p / count, stage);
      std::vector<std::shared_ptr<const DecodedPage>> decoded(batch.size());
      std::vector<std::vector<lod::VerifyReport>> reports(batch.size());
      parallel_for(batch.size(), 1, [&](size_t i) {
        decoded[i] = decode_whole_page(asset_, batch[i], checks);
        if (checks) reports[i] = check_clusters(*decoded[i]);
      });
      for (size_t i = 0; i < batch.size(); ++i)
        for (size_t g = 0; g < decoded[i]->groups.size(); ++g) {
          const PageGroup& group = decoded[i]->groups[g];
          if (checks) absorb(meshes_[group.mesh], reports[i][g], decoded[i]->problems[g]);
          if (wanted(meshes_[group.mesh], group.id)) visit(*decoded[i], g);
        }
      batch.clear();
    }
  }

  /// One report a group; that cannot be used at all if it counts no cut.
  std::vector<lod::VerifyReport> check_clusters(const DecodedPage& page) const {
    std::vector<lod::VerifyReport> reports(page.groups.size());
    for (size_t g = 0; g < page.groups.size(); ++g) {
      const PageGroup& group = page.groups[g];
      lod::Findings findings(reports[g]);
      bool usable = page.problems[g].empty();
      if (!usable)
        lod::name_unreadable(group.group.clusters.offset, page.problems[g].c_str(), findings);
      for (uint32_t c = 0; c < page.geometry[g].size(); ++c)
        usable &=
            lod::check_cluster(group.group.clusters.offset + c, group.clusters[c], group.group,
                               page.geometry[g][c], meshes_[group.mesh].config, findings);
      reports[g].cuts = usable;
    }
    return reports;
  }

  static void absorb(VerifiedMesh& mesh, const lod::VerifyReport& part,
                     const std::string& problem) {
    mesh.complete &= part.cuts > 0 && problem.empty();
    mesh.findings.absorb(part);
  }

  const Asset& asset_;
  std::deque<VerifiedMesh>& meshes_;
  uint64_t memory_;
  Progress& progress_;
};

}  // namespace

void read_source(const Asset& asset, std::deque<VerifiedMesh>& meshes, uint64_t memory,
                 Progress& progress) {
  SourceReader(asset, meshes, memory, progress).run();
}

}  // namespace umbel::asset
