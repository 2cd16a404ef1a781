#include "page_pool.hpp"

#include <algorithm>
#include <numeric>
#include <stdexcept>
#include <string>

#include "cluster_words.hpp"

namespace sample {

namespace {

constexpr uint32_t kUploads = 16;

std::vector<bool> find_root_pages(const umbel::Asset& asset) {
  std::vector<bool> found(asset.info().pages, false);
  for (const umbel::GroupRef& root : asset.roots()) found[root.page] = true;
  return found;
}

uint32_t count(const std::vector<bool>& pages) {
  return static_cast<uint32_t>(std::count(pages.begin(), pages.end(), true));
}

uint32_t slots_in(uint64_t budget_bytes, uint32_t slot_words, const std::vector<bool>& roots) {
  const uint64_t slots = budget_bytes / (4 * uint64_t{slot_words});
  if (slots < count(roots)) {
    throw std::runtime_error("the root pages alone need a budget of " +
                             std::to_string(4 * uint64_t{slot_words} * count(roots)) + " bytes.");
  }
  return static_cast<uint32_t>(std::min<uint64_t>(slots, roots.size()));
}

}  // namespace

PagePool::PagePool(const Device& device, const umbel::Asset& asset, const Tables& tables,
                   uint64_t budget_bytes)
    : tables_(tables),
      is_root_(find_root_pages(asset)),
      slot_words_(tables.largest_page_words()),
      slots_(slots_in(budget_bytes, slot_words_, is_root_)),
      uploads_(std::max(kUploads, count(is_root_))),
      slot_of_page_(asset.info().pages, umbel::kNone),
      coarser_(tables.host().groups.size()),
      coarse_first_(tables.host().groups.size()),
      words_(device, uint64_t{slots_} * slot_words_ * 4, Place::kDevice),
      staging_(device, uint64_t{uploads_} * slot_words_ * 4, Place::kHost),
      first_word_(device, slot_of_page_.size() * 4, Place::kHost),
      usable_(device, coarser_.size() * 4, Place::kHost) {
  for (uint32_t s = slots_; s-- > 0;) free_.push_back(s);
  for (const umbel::lod::Cluster& cluster : tables.host().clusters) {
    if (cluster.generating_group == umbel::kNone) continue;
    coarser_[cluster.generating_group].push_back(cluster.group);
  }
  for (std::vector<uint32_t>& groups : coarser_) {
    std::sort(groups.begin(), groups.end());
    groups.erase(std::unique(groups.begin(), groups.end()), groups.end());
  }
  // Groups are numbered by level, the finest first.
  std::iota(coarse_first_.rbegin(), coarse_first_.rend(), 0u);
}

void PagePool::update(const umbel::Asset& asset, const umbel::Residency& residency) {
  copies_.clear();
  const std::vector<uint32_t> resident = residency.resident_pages();
  for (uint32_t p = 0; p < slot_of_page_.size(); ++p) {
    if (slot_of_page_[p] == umbel::kNone) continue;
    if (std::binary_search(resident.begin(), resident.end(), p)) continue;
    free_.push_back(slot_of_page_[p]);
    slot_of_page_[p] = umbel::kNone;
  }
  for (const uint32_t p : missing_pages(residency)) {
    if (free_.empty() || copies_.size() == uploads_) break;
    slot_of_page_[p] = free_.back();
    free_.pop_back();
    decode(asset, *residency.page(p), slot_of_page_[p]);
  }
  mark_usable();
}

std::vector<uint32_t> PagePool::missing_pages(const umbel::Residency& residency) const {
  std::vector<uint32_t> missing;
  for (const uint32_t p : residency.resident_pages()) {
    if (slot_of_page_[p] == umbel::kNone) missing.push_back(p);
  }
  // Groups of coarse levels have high numbers.
  const auto coarsest = [&](uint32_t p) {
    const std::vector<uint32_t>& groups = tables_.pages()[p].groups;
    return groups.empty() ? 0u : *std::max_element(groups.begin(), groups.end());
  };
  std::sort(missing.begin(), missing.end(), [&](uint32_t a, uint32_t b) {
    if (is_root_[a] != is_root_[b]) return static_cast<bool>(is_root_[a]);
    return coarsest(a) != coarsest(b) ? coarsest(a) > coarsest(b) : a < b;
  });
  return missing;
}

void PagePool::decode(const umbel::Asset& asset, const umbel::AssetPage& page, uint32_t slot) {
  const size_t start = copies_.size() * slot_words_;
  const std::span<uint32_t> out = staging_.mapped<uint32_t>().subspan(start, slot_words_);
  size_t w = 0;
  for (size_t g = 0; g < page.groups.size(); ++g) {
    for (const umbel::lod::ClusterGeometry& cluster : asset.decode(page, g)) {
      write_cluster(cluster, out.subspan(w));
      w += words_of(static_cast<uint32_t>(cluster.positions.size()),
                    static_cast<uint32_t>(cluster.triangles.size() / 3));
    }
  }
  copies_.push_back({.srcOffset = start * 4,
                     .dstOffset = uint64_t{slot} * slot_words_ * 4,
                     .size = uint64_t{tables_.pages()[page.index].words} * 4});
}

void PagePool::mark_usable() {
  const std::span<uint32_t> first = first_word_.mapped<uint32_t>();
  const std::span<uint32_t> usable = usable_.mapped<uint32_t>();
  std::fill(usable.begin(), usable.end(), 0u);
  for (uint32_t p = 0; p < slot_of_page_.size(); ++p) {
    const bool here = slot_of_page_[p] != umbel::kNone;
    first[p] = here ? slot_of_page_[p] * slot_words_ : umbel::kNone;
    for (const uint32_t g : tables_.pages()[p].groups) usable[g] = here ? 1 : 0;
  }
  for (const uint32_t g : coarse_first_) {
    for (const uint32_t above : coarser_[g]) usable[g] &= usable[above];
  }
}

void PagePool::record(VkCommandBuffer commands) {
  if (copies_.empty()) return;
  vkCmdCopyBuffer(commands, staging_.handle(), words_.handle(),
                  static_cast<uint32_t>(copies_.size()), copies_.data());
}

}  // namespace sample
