#include "scale/undecided_edges.hpp"

#include <cerrno>
#include <fstream>
#include <string>
#include <system_error>
#include <utility>

#include "base/file.hpp"
#include "base/hash.hpp"
#include "mesh/vertex_bits.hpp"
#include "scale/route_exits.hpp"
#include "scale/work_folder.hpp"

namespace umbel::scale {
namespace {

// Of a bucket, held until they are written.
constexpr size_t kHeldEdges = 1 << 14;

// The same for both directions.
uint64_t hash_of(const PositionEdge& edge) {
  const auto hash = [](const Vec3& p) {
    uint64_t h = 0;
    for (const uint32_t bits : value_bits(p)) h = mix64(h ^ bits);
    return h;
  };
  return mix64(hash(edge.from) + hash(edge.to));
}

}  // namespace

UndecidedEdges::UndecidedEdges(std::filesystem::path folder, uint64_t edges, uint64_t most)
    : folder_(std::move(folder)), buckets_(1 + edges / most) {
  if (buckets_.size() == 1) return;
  std::filesystem::remove_all(folder_);
  make_folder(folder_);
}

UndecidedEdges::~UndecidedEdges() {
  std::error_code ignored;
  std::filesystem::remove_all(folder_, ignored);
}

void UndecidedEdges::add(std::span<const PositionEdge> edges) {
  if (buckets_.size() == 1) {
    buckets_[0].insert(buckets_[0].end(), edges.begin(), edges.end());
    return;
  }
  for (const PositionEdge& edge : edges) {
    const size_t bucket = hash_of(edge) % buckets_.size();
    buckets_[bucket].push_back(edge);
    if (buckets_[bucket].size() >= kHeldEdges) write(bucket);
  }
}

std::vector<PositionEdge> UndecidedEdges::non_manifold() {
  if (buckets_.size() == 1) return non_manifold_edges(std::move(buckets_[0]));
  std::vector<PositionEdge> result;
  for (size_t b = 0; b < buckets_.size(); ++b) {
    write(b);
    std::vector<PositionEdge> edges(std::filesystem::file_size(file(b)) / sizeof(PositionEdge));
    InputFile(file(b)).read(0, std::as_writable_bytes(std::span(edges)));
    const std::vector<PositionEdge> found = non_manifold_edges(std::move(edges));
    result.insert(result.end(), found.begin(), found.end());
    std::filesystem::remove(file(b));
  }
  return result;
}

std::filesystem::path UndecidedEdges::file(size_t bucket) const {
  return folder_ / std::to_string(bucket);
}

void UndecidedEdges::write(size_t bucket) {
  std::ofstream out(file(bucket), std::ios::binary | std::ios::app);
  out.write(reinterpret_cast<const char*>(buckets_[bucket].data()),
            static_cast<std::streamsize>(buckets_[bucket].size() * sizeof(PositionEdge)));
  out.close();
  if (!out)
    throw Error(ErrorCode::kIo, "cannot write " + file(bucket).string() + ": " +
                                    std::generic_category().message(errno));
  buckets_[bucket].clear();
}

}  // namespace umbel::scale
