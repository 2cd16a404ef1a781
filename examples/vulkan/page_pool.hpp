// Pages on the device: equal slots of one buffer, as many as the budget holds. What the residency
// has in memory is decoded into a slot; what it evicts frees its slot.
#pragma once

#include <cstdint>
#include <umbel/umbel.hpp>
#include <vector>

#include "memory.hpp"
#include "tables.hpp"

namespace sample {

class PagePool {
 public:
  /// Throws for a budget that does not hold the asset's root pages, which come first and stay.
  PagePool(const Device& device, const umbel::Asset& asset, const Tables& tables,
           uint64_t budget_bytes);

  /// Frees and fills slots so that they hold what the residency holds, a few pages a frame
  /// and coarse pages first, and says anew which groups are usable: those in a slot, all of whose
  /// coarser groups are usable. Call before `record`.
  void update(const umbel::Asset& asset, const umbel::Residency& residency);
  /// Copies what `update` has decoded.
  void record(VkCommandBuffer commands);

  const Buffer& words() const { return words_; }
  const Buffer& first_word() const { return first_word_; }
  const Buffer& usable() const { return usable_; }
  /// Where a cluster of a usable group lies, in `words`.
  uint64_t word_of(const Tables& tables, uint32_t cluster) const {
    const uint32_t page = tables.page_of_group(tables.host().clusters[cluster].group);
    return uint64_t{first_word_.mapped<uint32_t>()[page]} + tables.word_of_cluster(cluster);
  }
  uint32_t slots() const { return slots_; }
  uint32_t used() const { return slots_ - static_cast<uint32_t>(free_.size()); }

 private:
  /// Pages that the residency has and that have no slot, in the order in which they get one.
  std::vector<uint32_t> missing_pages(const umbel::Residency& residency) const;
  void decode(const umbel::Asset& asset, const umbel::AssetPage& page, uint32_t slot);
  void mark_usable();

  const Tables& tables_;
  std::vector<bool> is_root_;  ///< one a page
  uint32_t slot_words_, slots_;
  uint32_t uploads_;  ///< most a frame; all root pages at least, or the first would have holes
  std::vector<uint32_t> free_;
  std::vector<uint32_t> slot_of_page_;
  std::vector<VkBufferCopy> copies_;
  /// Each group's coarser groups: those that its own clusters' simplified form belongs to.
  std::vector<std::vector<uint32_t>> coarser_;
  std::vector<uint32_t> coarse_first_;  ///< groups, coarser ones before those made finer from them
  Buffer words_, staging_, first_word_, usable_;
};

}  // namespace sample
