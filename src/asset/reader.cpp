// An open asset. The head is read and checked once; pages are read when asked for, and the first
// read of a page checks its checksum.
#include <algorithm>
#include <atomic>

#include "asset/format.hpp"
#include "asset/page.hpp"
#include "base/bytes.hpp"
#include "base/file.hpp"
#include "base/hash.hpp"

namespace umbel {

using asset::ClusterEntry;
using asset::PageEntry;

struct Asset::State {
  explicit State(const std::filesystem::path& path) : file(path) {}

  InputFile file;
  asset::Head head;
  std::vector<uint32_t> page_of_group;
  std::vector<uint32_t> group_of_cluster;  // by the groups' ranges: where it is stored
  std::vector<std::atomic<bool>> known_whole;

  void read_head();
  void index_pages();
  bool has_right_checksum(const PageEntry& page) const;
  void check_page(const PageEntry& page) const;
  lod::ClusterGeometry read_cluster(const PageEntry& page, uint32_t index) const;
};

void Asset::State::read_head() {
  std::vector<std::byte> bytes(asset::kPrologueBytes);
  const auto read_up_to = [&](uint64_t size) {
    if (size > file.size()) corrupt("the file ends within its header");
    const size_t have = bytes.size();
    bytes.resize(size);
    file.read(have, std::span(bytes).subspan(have));
  };
  if (file.size() < bytes.size()) corrupt("this is not a .umbel file");
  file.read(0, bytes);
  read_up_to(asset::header_bytes_in(bytes));
  read_up_to(asset::head_bytes_in(bytes, file.size()));
  head = asset::decode_head(bytes);
}

void Asset::State::index_pages() {
  page_of_group.resize(head.pages.size());
  for (uint32_t i = 0; i < head.pages.size(); ++i) page_of_group[head.pages[i].group] = i;
  group_of_cluster.resize(head.tables.clusters.size());
  for (uint32_t g = 0; g < head.tables.groups.size(); ++g) {
    const Range& range = head.tables.groups[g].clusters;
    for (uint32_t c = 0; c < range.count; ++c) group_of_cluster[range.offset + c] = g;
  }
  known_whole = std::vector<std::atomic<bool>>(head.pages.size());
}

bool Asset::State::has_right_checksum(const PageEntry& page) const {
  std::vector<std::byte> bytes(page.bytes);
  file.read(page.offset, bytes);
  return xxh64(bytes.data(), bytes.size()) == page.checksum;
}

void Asset::State::check_page(const PageEntry& page) const {
  const std::string name = "the page of group " + std::to_string(page.group);
  if (!has_right_checksum(page)) corrupt("the checksum of " + name + " does not hold");
  std::vector<std::byte> bytes(page.bytes);
  file.read(page.offset, bytes);
  const asset::PageHeader header = asset::decode_page_header(head.format, bytes);
  const Range& clusters = head.tables.groups[page.group].clusters;
  if (header.group != page.group || header.clusters != clusters)
    corrupt(name + " does not say what the tables say of it");
}

lod::ClusterGeometry Asset::State::read_cluster(const PageEntry& page, uint32_t index) const {
  const Range& clusters = head.tables.groups[page.group].clusters;
  std::vector<std::byte> bytes(
      std::min(page.bytes, asset::page_header_bytes(head.format, clusters.count)));
  file.read(page.offset, bytes);
  const asset::PageHeader header = asset::decode_page_header(head.format, bytes);
  const ClusterEntry entry =
      asset::decode_cluster_entry(head.format, header, bytes, index, page.bytes);
  std::vector<std::byte> data(entry.end - entry.begin);
  file.read(page.offset + entry.begin, data);
  return asset::decode_cluster(head.format, header, entry, data);
}

Asset::Asset(const std::filesystem::path& path) {
  state_ = std::make_unique<State>(path);
  try {
    state_->read_head();
  } catch (const Error& error) {
    if (error.code() == ErrorCode::kIo) throw;
    throw Error(error.code(), path.string() + ": " + error.what());
  }
  state_->index_pages();
}

Asset::Asset(Asset&&) noexcept = default;
Asset& Asset::operator=(Asset&&) noexcept = default;
Asset::~Asset() = default;

const AssetInfo& Asset::info() const { return state_->head.info; }

const lod::Tables& Asset::tables() const { return state_->head.tables; }

lod::ClusterGeometry Asset::geometry(uint32_t cluster) const {
  const lod::Tables& tables = state_->head.tables;
  if (cluster >= tables.clusters.size())
    throw Error(ErrorCode::kInvalidArgument, "cluster is " + std::to_string(cluster) +
                                                 ", but the asset has " +
                                                 std::to_string(tables.clusters.size()));
  const uint32_t group = state_->group_of_cluster[cluster];
  const uint32_t page_index = state_->page_of_group[group];
  const PageEntry& page = state_->head.pages[page_index];
  std::atomic<bool>& whole = state_->known_whole[page_index];
  if (!whole.load(std::memory_order_relaxed)) {
    state_->check_page(page);
    whole.store(true, std::memory_order_relaxed);
  }
  try {
    return state_->read_cluster(page, cluster - tables.groups[group].clusters.offset);
  } catch (const Error& error) {
    throw Error(error.code(), "cluster " + std::to_string(cluster) + ": " + error.what());
  }
}

bool Asset::page_is_whole(uint32_t group) const {
  if (group >= state_->page_of_group.size())
    throw Error(ErrorCode::kInvalidArgument, "group is " + std::to_string(group) +
                                                 ", but the asset has " +
                                                 std::to_string(state_->page_of_group.size()));
  return state_->has_right_checksum(state_->head.pages[state_->page_of_group[group]]);
}

}  // namespace umbel
