#include "asset/file/page_plan.hpp"

#include <algorithm>
#include <utility>

#include "asset/file/page.hpp"

namespace umbel::asset {
namespace {

/// How many groups that do not fit a page any more are passed by in search of one that does.
constexpr size_t kReach = 12;

class Planner {
 public:
  Planner(std::span<std::vector<GroupEntry>> meshes, uint32_t page_bytes) : meshes_(meshes) {
    for (const std::vector<GroupEntry>& groups : meshes_) {
      uint32_t& coarsest = coarsest_.emplace_back(0);
      for (const GroupEntry& entry : groups) coarsest = std::max(coarsest, entry.group.level);
    }
    plan_.page_bytes = page_bytes > 0 ? page_bytes : page_bytes_for(all_bytes());
  }

  PagePlan run() {
    order_groups();
    fill_pages();
    return std::move(plan_);
  }

 private:
  GroupEntry& entry(const GroupName& name) { return meshes_[name.mesh][name.group]; }
  static uint64_t bytes_of(const GroupEntry& entry) {
    return kGroupRecordBytes + entry.chunk_bytes;
  }
  /// Below the coarsest level of its mesh.
  uint32_t depth(const GroupName& name) { return coarsest_[name.mesh] - entry(name).group.level; }

  uint64_t all_bytes() const {
    uint64_t bytes = 0;
    for (const std::vector<GroupEntry>& groups : meshes_)
      for (const GroupEntry& entry : groups) bytes += bytes_of(entry);
    return bytes;
  }

  /// Coarsest first in every mesh, meshes side by side: any prefix of the pages shows all of them.
  void order_groups() {
    std::vector<size_t> first;  // by depth
    const auto for_each = [&](const auto& visit) {
      for (uint32_t m = 0; m < meshes_.size(); ++m)
        for (uint32_t g = 0; g < meshes_[m].size(); ++g) visit(GroupName{m, g});
    };
    for_each([&](const GroupName& name) {
      if (first.size() < depth(name) + size_t{2}) first.resize(depth(name) + size_t{2});
      ++first[depth(name) + size_t{1}];
    });
    for (size_t d = 1; d < first.size(); ++d) first[d] += first[d - 1];
    order_.resize(first.empty() ? 0 : first.back());
    for_each([&](const GroupName& name) { order_[first[depth(name)]++] = name; });
  }

  /// Fills pages one after the other, each with the next group and with what fits of those soon
  /// after it, as long as they are as far below the coarsest level: parents stay in front.
  void fill_pages() {
    std::vector<bool> is_in_page(order_.size());
    plan_.order.reserve(order_.size());
    for (size_t next = 0; next < order_.size(); ++next) {
      if (is_in_page[next]) continue;
      const auto page = static_cast<uint32_t>(plan_.pages.size());
      plan_.pages.push_back({static_cast<uint32_t>(plan_.order.size()), 0});
      uint64_t bytes = kPageHeaderBytes;
      size_t passed = 0;
      for (size_t i = next; i < order_.size() && passed <= kReach; ++i) {
        if (is_in_page[i]) continue;
        if (passed > 0 && depth(order_[i]) != depth(order_[next])) break;
        GroupEntry& group = entry(order_[i]);
        if (i > next && bytes + bytes_of(group) > plan_.page_bytes) {
          ++passed;
          continue;
        }
        bytes += bytes_of(group);
        is_in_page[i] = true;
        group.page = page;
        ++plan_.pages.back().count;
        plan_.order.push_back(order_[i]);
      }
    }
  }

  std::span<std::vector<GroupEntry>> meshes_;
  std::vector<uint32_t> coarsest_;  // level of each mesh
  std::vector<GroupName> order_;    // coarsest first
  PagePlan plan_;
};

}  // namespace

PagePlan plan_pages(std::span<std::vector<GroupEntry>> meshes, uint32_t page_bytes) {
  return Planner(meshes, page_bytes).run();
}

}  // namespace umbel::asset
