#include "asset/file/check_header.hpp"

#include <cmath>

#include "asset/file/page.hpp"
#include "base/bytes.hpp"
#include "base/math.hpp"

namespace umbel::asset {
namespace {

void check_range(const char* what, size_t mesh, const Range& range, size_t size) {
  if (range.offset > size || range.count > size - range.offset)
    corrupt("mesh " + std::to_string(mesh) + " has " + what + " [" + std::to_string(range.offset) +
            ", " + std::to_string(uint64_t{range.offset} + range.count) + "), but there are " +
            std::to_string(size));
}

/// Pages that are read in slices are not all known; then groups must only fit into the file.
void check_groups(const FileHeader& header, uint64_t groups) {
  if (header.has_page_slices && groups > header.info.file_bytes / kGroupRecordBytes)
    corrupt("the meshes have " + std::to_string(groups) + " groups");
  if (header.has_page_slices) return;
  uint64_t in_pages = 0;
  for (const PageEntry& page : header.pages) in_pages += page.groups;
  if (groups != in_pages)
    corrupt("the pages have " + std::to_string(in_pages) + " groups, but the meshes " +
            std::to_string(groups));
}

void check_meshes(const FileHeader& header) {
  uint64_t groups = 0, clusters = 0;
  for (size_t i = 0; i < header.meshes.size(); ++i) {
    const MeshEntry& entry = header.meshes[i];
    check_range("attributes", i, entry.attributes, header.attributes.size());
    check_range("levels", i, entry.levels, header.levels.size());
    check_range("roots", i, entry.roots, header.roots.size());
    check_range("nodes", i, entry.nodes, header.nodes.count);
    if (entry.attributes.count > kMaxAttributes)
      corrupt("mesh " + std::to_string(i) + " has " + std::to_string(entry.attributes.count) +
              " attributes");
    for (uint32_t r = 0; r < entry.roots.count; ++r) {
      const GroupRef& root = header.roots[entry.roots.offset + r];
      if (root.group >= entry.mesh.groups || root.page >= header.info.pages)
        corrupt("root " + std::to_string(r) + " is group " + std::to_string(root.group) +
                " in page " + std::to_string(root.page) + ", which is not there");
    }
    groups += entry.mesh.groups;
    clusters += entry.mesh.clusters;
  }
  check_groups(header, groups);
  // What a table of them takes must not be more than the file can back.
  if (clusters > header.info.file_bytes)
    corrupt("the meshes have " + std::to_string(clusters) + " clusters");
  for (const Instance& instance : header.instances) {
    if (instance.mesh >= header.meshes.size())
      corrupt("an instance is of mesh " + std::to_string(instance.mesh) + ", but there are " +
              std::to_string(header.meshes.size()));
    for (const float f : instance.transform.rows)
      if (!std::isfinite(f)) corrupt("an instance's transform is not finite");
  }
}

void check_files(const FileHeader& header) {
  const uint64_t earliest = header.pages.empty()
                                ? header.info.header_bytes
                                : header.pages.back().offset + header.pages.back().bytes;
  for (size_t i = 0; i < header.files.size(); ++i)
    if (!inside(header.files[i].offset, header.files[i].bytes, earliest, header.info.file_bytes))
      corrupt("embedded file " + std::to_string(i) + " has " +
              std::to_string(header.files[i].bytes) + " bytes at byte " +
              std::to_string(header.files[i].offset) + " of a file of " +
              std::to_string(header.info.file_bytes));
}

}  // namespace

void check_header(const FileHeader& header) {
  if (!is_finite(header.info.origin)) corrupt("the asset's origin is not finite");
  check_meshes(header);
  check_pages(header.info, header.pages, 0, header.info.header_bytes);
  check_files(header);
}

void check_pages(const AssetInfo& info, std::span<const PageEntry> pages, uint32_t first,
                 uint64_t earliest) {
  // In order, so that reading all pages is reading the file once.
  for (size_t i = 0; i < pages.size(); ++i) {
    const PageEntry& page = pages[i];
    if (page.offset % page_alignment(info.version_major) != 0 ||
        !inside(page.offset, page.bytes, earliest, info.file_bytes) ||
        page.groups > page.bytes / kGroupRecordBytes)
      corrupt("page " + std::to_string(first + i) + " has " + std::to_string(page.groups) +
              " groups in " + std::to_string(page.bytes) + " bytes at byte " +
              std::to_string(page.offset) + " of a file of " + std::to_string(info.file_bytes));
    earliest = page.offset + page.bytes;
  }
}

}  // namespace umbel::asset
