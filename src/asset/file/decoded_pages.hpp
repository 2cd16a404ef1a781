// Pages with their clusters' positions and triangles, decoded, of which those used last are kept.
#pragma once

#include <list>
#include <memory>
#include <span>
#include <string>
#include <unordered_map>
#include <vector>

#include "umbel/asset.hpp"

namespace umbel::asset {

struct DecodedPage {
  uint32_t index = 0;
  std::vector<PageGroup> groups;
  /// Of each group's clusters.
  std::vector<std::vector<lod::ClusterGeometry>> geometry;
  std::vector<std::string> problems;  ///< of each group: why it could not be decoded, or ""
  uint64_t bytes = 0;                 ///< that it takes, about

  /// The index of a group that the page has.
  uint32_t find(uint32_t mesh, uint32_t group) const;
};

/// With all attributes, or with positions and triangles alone.
std::shared_ptr<const DecodedPage> decode_whole_page(const Asset& asset, uint32_t page,
                                                     bool attributes);

/// For one thread, which may use many to load.
class DecodedPages {
 public:
  DecodedPages(const Asset& asset, uint64_t most_bytes) : asset_(asset), most_(most_bytes) {}

  /// Has all of these pages at hand until the next call. They are not repeated.
  void load(std::span<const uint32_t> pages);
  const DecodedPage& at(uint32_t page) const { return *known_.at(page).page; }
  uint64_t decoded() const { return decoded_; }

 private:
  struct Known {
    std::shared_ptr<const DecodedPage> page;
    std::list<uint32_t>::iterator used;
  };

  const Asset& asset_;
  uint64_t most_, bytes_ = 0, decoded_ = 0;
  std::unordered_map<uint32_t, Known> known_;
  std::list<uint32_t> recent_;  // the least recently used first
};

}  // namespace umbel::asset
