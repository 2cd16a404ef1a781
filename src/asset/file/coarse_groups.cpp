#include "asset/file/coarse_groups.hpp"

#include <algorithm>
#include <string>

#include "asset/file/records.hpp"

namespace umbel::asset {
namespace {

struct Element {
  GroupRef group;
  uint32_t triangles, references;
};

void append(const Element& element, std::vector<std::byte>& table) {
  const size_t at = table.size();
  table.resize(at + kCoarseBytes);
  ByteWriter out{std::span<std::byte>(table)};
  out.skip_to(at);
  write(out, element.group);
  out.u32(element.triangles);
  out.u32(element.references);
}

class Decoder {
 public:
  Decoder(std::span<const std::byte> table, const FileHeader& header)
      : header_(header), in_(table) {}

  std::vector<CoarseGroups> run() {
    std::vector<CoarseGroups> meshes;
    for (const MeshEntry& mesh : header_.meshes) {
      CoarseGroups& coarse = meshes.emplace_back();
      coarse.first = next().group.group;
      for (uint32_t g = coarse.first; g < mesh.mesh.groups; ++g)
        coarse.groups.push_back(next_group(g, mesh.mesh.groups));
    }
    if (at_ != header_.coarse.count) wrong();
    return meshes;
  }

 private:
  [[noreturn]] static void wrong() {
    corrupt("the table of coarse groups has others than the meshes");
  }

  Element next() {
    if (at_ == header_.coarse.count) wrong();
    in_.skip_to(at_++ * header_.coarse.element_bytes);
    Element element{};
    read(in_, element.group);
    element.triangles = in_.u32();
    element.references = in_.u32();
    return element;
  }

  Element next_in(uint32_t groups) {
    const Element element = next();
    if (element.group.group >= groups || element.group.page >= header_.info.pages)
      corrupt("the table of coarse groups has group " + std::to_string(element.group.group) +
              " in page " + std::to_string(element.group.page) + ", which is not there");
    return element;
  }

  Refinement next_group(uint32_t group, uint32_t groups) {
    const Element own = next_in(groups);
    if (own.group.group != group) wrong();
    Refinement made;
    made.triangles = own.triangles;
    for (uint32_t r = 0; r < own.references; ++r) {
      const Element part = next_in(groups);
      if (part.references > 0) wrong();
      made.parts.push_back({part.group, part.triangles});
    }
    return made;
  }

  const FileHeader& header_;
  ByteReader in_;
  uint64_t at_ = 0;
};

}  // namespace

uint32_t first_coarse(const FileHeader& header, const MeshEntry& mesh) {
  // A quarter of the groups, or an eighth where that would take some 20 MB.
  constexpr uint64_t kManyGroups = 1u << 18;
  uint64_t groups = 0;
  for (const MeshEntry& one : header.meshes) groups += one.mesh.groups;
  const uint32_t level = groups < kManyGroups ? 2 : 3;
  if (mesh.levels.count <= level) return mesh.mesh.groups;
  return std::min(header.levels[mesh.levels.offset + level].offset, mesh.mesh.groups);
}

Refinement refinement_of(std::span<const lod::Cluster> clusters,
                         std::span<const GroupRef> children) {
  Refinement made;
  for (const GroupRef& child : children) made.parts.push_back({child, 0});
  for (const lod::Cluster& cluster : clusters) {
    uint32_t* at = &made.triangles;
    for (Refinement::Part& part : made.parts)
      if (part.group.group == cluster.generating_group) at = &part.triangles;
    *at += cluster.triangle_count;
  }
  return made;
}

void check_coarse(const Refinement* known, const PageGroup& group) {
  if (known && *known != refinement_of(group.clusters, group.children))
    corrupt("the table of coarse groups says other things of group " + std::to_string(group.id) +
            " than its page");
}

void append_first(uint32_t group, std::vector<std::byte>& table) {
  append({{group, 0, 0, {}, 0}, 0, 0}, table);
}

void append_coarse(const GroupRef& group, const Refinement& refinement,
                   std::vector<std::byte>& table) {
  append({group, refinement.triangles, static_cast<uint32_t>(refinement.parts.size())}, table);
  for (const Refinement::Part& part : refinement.parts)
    append({part.group, part.triangles, 0}, table);
}

std::vector<CoarseGroups> decode_coarse(std::span<const std::byte> table,
                                        const FileHeader& header) {
  return Decoder(table, header).run();
}

}  // namespace umbel::asset
