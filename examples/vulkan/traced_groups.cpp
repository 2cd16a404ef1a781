#include "traced_groups.hpp"

namespace sample {

void TracedGroups::begin() {
  ++frame_;
  built_ = 0;
  shown_.clear();
  clusters_.clear();
}

uint32_t TracedGroups::show(std::span<const uint32_t> clusters) {
  const auto found = entries_.try_emplace({clusters.begin(), clusters.end()}).first;
  Entry& entry = found->second;
  if (entry.frame != frame_) {
    entry.frame = frame_;
    entry.number = static_cast<uint32_t>(shown_.size());
    entry.first = static_cast<uint32_t>(clusters_.size());
    shown_.push_back(found);
    clusters_.insert(clusters_.end(), clusters.begin(), clusters.end());
  }
  return entry.number;
}

void TracedGroups::build(const Tables& tables, const PagePool& pool) {
  std::erase_if(entries_, [&](const auto& entry) { return entry.second.frame != frame_; });
  std::vector<std::vector<uint32_t>> sets;
  std::vector<Entry*> missing;
  for (const Entries::iterator& at : shown_) {
    if (at->second.structure.address != 0) continue;
    missing.push_back(&at->second);
    sets.push_back(at->first);
  }
  built_ = static_cast<uint32_t>(missing.size());
  if (missing.empty()) return;
  const std::vector<GroupStructure> structures = builder_->build(sets, tables, pool);
  for (size_t i = 0; i < missing.size(); ++i) missing[i]->structure = structures[i];
}

uint64_t TracedGroups::bytes() const {
  uint64_t sum = 0;
  for (const auto& [clusters, entry] : entries_) sum += entry.structure.bytes;
  return sum;
}

}  // namespace sample
