#include "asset/file/paged_tables.hpp"

#include <algorithm>
#include <bit>
#include <numeric>
#include <optional>

#include "asset/file/coarse_groups.hpp"
#include "asset/file/follow_reference.hpp"
#include "asset/file/verify_parts.hpp"
#include "base/hash.hpp"
#include "base/parallel.hpp"

namespace umbel::asset {
namespace {

constexpr uint32_t kPagesAtOnce = 32;  // pages

/// What a group must be for all references to it to hold; never 0.
uint64_t digest_of(uint32_t page, float error, const Sphere& sphere) {
  const std::array<uint32_t, 4> words = std::bit_cast<std::array<uint32_t, 4>>(sphere);
  const uint64_t first = uint64_t{page} << 32 | std::bit_cast<uint32_t>(error);
  return mix64(mix64(mix64(first) ^ (uint64_t{words[0]} << 32 | words[1])) ^
               (uint64_t{words[2]} << 32 | words[3])) |
         1;
}

/// One mesh's tables as pages come.
class Collector {
 public:
  explicit Collector(const AssetMesh& mesh) : digests_(mesh.groups) {
    made_.tables.groups.resize(mesh.groups);
    made_.pages.assign(mesh.groups, kNone);
    made_.has_source.resize(mesh.groups);
  }

  void add(const PageGroup& group, uint32_t page) {
    if (made_.pages[group.id] != kNone)
      corrupt("group " + std::to_string(group.id) + " is in two pages");
    made_.pages[group.id] = page;
    made_.tables.groups[group.id] = group.group;
    expect(group.id, digest_of(page, group.group.error, group.group.sphere));
    for (const GroupRef& child : group.children) {
      refer(child);
      links_.push_back(uint64_t{child.group} << 32 | group.id);
    }
    for (const lod::Cluster& cluster : group.clusters) {
      if (cluster.generating_group != kNone) continue;
      made_.has_source[group.id] = true;
      made_.source_triangles += cluster.triangle_count;
    }
  }

  void refer(const GroupRef& reference) {
    expect(reference.group, digest_of(reference.page, reference.error, reference.sphere));
  }

  GroupTables take() {
    const size_t groups = made_.pages.size();
    made_.parent_offsets.assign(groups + 1, 0);
    for (const uint64_t link : links_) ++made_.parent_offsets[(link >> 32) + 1];
    std::partial_sum(made_.parent_offsets.begin(), made_.parent_offsets.end(),
                     made_.parent_offsets.begin());
    made_.parents.resize(links_.size());
    std::vector<uint32_t> next(made_.parent_offsets.begin(), made_.parent_offsets.end() - 1);
    for (const uint64_t link : links_)
      made_.parents[next[link >> 32]++] = static_cast<uint32_t>(link);
    return std::move(made_);
  }

 private:
  void expect(uint32_t group, uint64_t digest) {
    if (digests_[group] == 0) digests_[group] = digest;
    if (digests_[group] != digest) disagree({group, 0, 0, {}, 0});
  }

  GroupTables made_;
  std::vector<uint64_t> digests_;
  std::vector<uint64_t> links_;  // child, parent
};

}  // namespace

uint64_t group_table_bytes(const Asset& asset) {
  // A group and its page, digest and some ten links, each of which is there twice for a while; a
  // bit a cluster; a node and a quarter a group.
  constexpr uint64_t kGroup = sizeof(lod::Group) + 4 + 8 + 10 * 12 + 5 * sizeof(lod::Node) / 4;
  uint64_t bytes = 0;
  for (const AssetMesh& mesh : asset.meshes()) bytes += kGroup * mesh.groups + mesh.clusters / 8;
  return bytes;
}

std::vector<GroupTables> read_group_tables(const Asset& asset, Progress& progress, double share,
                                           std::vector<std::string>& broken) {
  std::vector<Collector> collectors;
  uint64_t groups = 0, found = 0;
  for (const AssetMesh& mesh : asset.meshes()) {
    collectors.emplace_back(mesh);
    groups += mesh.groups;
  }
  for (uint32_t m = 0; m < collectors.size(); ++m)
    for (const GroupRef& root : asset.roots(m)) collectors[m].refer(root);
  const uint32_t pages = asset.info().pages;
  for (uint32_t begin = 0; begin < pages; begin += kPagesAtOnce) {
    progress.report(share * begin / pages, "reading pages");
    const uint32_t count = std::min(kPagesAtOnce, pages - begin);
    std::vector<std::optional<AssetPage>> batch(count);
    std::vector<std::string> problems(count);
    parallel_for(count, 1, [&](size_t i) {
      try {
        batch[i] = asset.read_page(begin + static_cast<uint32_t>(i));
      } catch (const Error& error) {
        if (!is_damage(error)) throw;
        problems[i] = error.what();
      }
    });
    for (uint32_t i = 0; i < count; ++i) {
      if (!batch[i]) broken.push_back(problems[i]);
      if (!batch[i] || !broken.empty()) continue;
      for (const PageGroup& group : batch[i]->groups) {
        check_coarse(asset.refinement(group.id, group.mesh), group);
        collectors[group.mesh].add(group, begin + i);
      }
      found += batch[i]->groups.size();
    }
  }
  if (broken.empty() && found != groups)
    corrupt("the pages have " + std::to_string(found) + " groups, but the meshes " +
            std::to_string(groups));
  std::vector<GroupTables> all;
  for (uint32_t m = 0; m < collectors.size() && broken.empty(); ++m) {
    all.push_back(collectors[m].take());
    const std::span<const Range> levels = asset.levels(m);
    all.back().tables.levels.assign(levels.begin(), levels.end());
    all.back().tables.nodes = asset.nodes(m);
  }
  return all;
}

}  // namespace umbel::asset
