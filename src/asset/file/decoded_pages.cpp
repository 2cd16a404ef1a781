#include "asset/file/decoded_pages.hpp"

#include <algorithm>

#include "base/bytes.hpp"
#include "base/parallel.hpp"

namespace umbel::asset {
namespace {

uint64_t bytes_of(const lod::ClusterGeometry& cluster) {
  return sizeof cluster + 12 * cluster.positions.capacity() + cluster.triangles.capacity() + 48;
}

void drop_attributes(lod::ClusterGeometry& cluster) {
  lod::ClusterGeometry kept;
  kept.positions = std::move(cluster.positions);
  kept.triangles = std::move(cluster.triangles);
  cluster = std::move(kept);
}

}  // namespace

uint32_t DecodedPage::find(uint32_t mesh, uint32_t group) const {
  for (uint32_t i = 0; i < groups.size(); ++i)
    if (groups[i].mesh == mesh && groups[i].id == group) return i;
  corrupt("group " + std::to_string(group) + " is not in page " + std::to_string(index));
}

std::shared_ptr<const DecodedPage> decode_whole_page(const Asset& asset, uint32_t page,
                                                     bool attributes) {
  AssetPage read = asset.read_page(page);
  auto made = std::make_shared<DecodedPage>();
  made->index = page;
  made->geometry.resize(read.groups.size());
  made->problems.resize(read.groups.size());
  for (size_t i = 0; i < read.groups.size(); ++i) {
    try {
      made->geometry[i] = asset.decode(read, i);
    } catch (const Error& error) {
      made->problems[i] = error.what();
    }
    for (lod::ClusterGeometry& cluster : made->geometry[i]) {
      if (!attributes) drop_attributes(cluster);
      made->bytes += bytes_of(cluster) + sizeof(lod::Cluster);
    }
    made->bytes += 512;
  }
  made->groups = std::move(read.groups);
  return made;
}

void DecodedPages::load(std::span<const uint32_t> pages) {
  std::vector<uint32_t> missing;
  for (const uint32_t page : pages) {
    const auto at = known_.find(page);
    if (at == known_.end())
      missing.push_back(page);
    else
      recent_.splice(recent_.end(), recent_, at->second.used);
  }
  std::vector<std::shared_ptr<const DecodedPage>> made(missing.size());
  parallel_for(made.size(), 1,
               [&](size_t i) { made[i] = decode_whole_page(asset_, missing[i], false); });
  for (auto& page : made) {
    const uint32_t index = page->index;
    bytes_ += page->bytes;
    known_[index] = {std::move(page), recent_.insert(recent_.end(), index)};
  }
  decoded_ += made.size();
  // Those of this call stand last, and stay.
  while (bytes_ > most_ && known_.size() > pages.size()) {
    const auto oldest = known_.find(recent_.front());
    bytes_ -= oldest->second.page->bytes;
    known_.erase(oldest);
    recent_.pop_front();
  }
}

}  // namespace umbel::asset
