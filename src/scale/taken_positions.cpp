#include "scale/taken_positions.hpp"

#include <algorithm>
#include <bit>

#include "mesh/vertex_bits.hpp"
#include "scale/work_file.hpp"

namespace umbel::scale {
namespace {

// Four to eight bits a triangle, as far as that is little; then one to two.
constexpr uint64_t kLeastBits = 1 << 16, kFewBits = uint64_t{1} << 29,
                   kMostBits = uint64_t{1} << 31;

struct Words {
  std::vector<uint64_t> words;
};

template <typename Visit>
void for_each_array(Words& words, Visit& visit) {
  visit(words.words);
}

uint64_t words_for(uint64_t triangles) {
  const uint64_t most = std::clamp(std::bit_ceil(triangles), kFewBits, kMostBits);
  return std::clamp(std::bit_ceil(4 * triangles), kLeastBits, most) / 64;
}

}  // namespace

TakenPositions::TakenPositions(uint64_t triangles) : words_(words_for(triangles), 0) {}

uint64_t TakenPositions::bytes(uint64_t triangles) { return 8 * words_for(triangles); }

uint64_t TakenPositions::bit_of(const Vec3& position) const {
  return hash_value(position, 0) & (64 * words_.size() - 1);
}

void TakenPositions::add(std::span<const Vec3> positions) {
  for (const Vec3& p : positions) {
    const uint64_t bit = bit_of(p);
    words_[bit / 64] |= uint64_t{1} << bit % 64;
  }
}

bool TakenPositions::may_contain(const Vec3& position) const {
  const uint64_t bit = bit_of(position);
  return (words_[bit / 64] >> bit % 64 & 1) != 0;
}

void TakenPositions::write(const std::filesystem::path& path) {
  Words record{std::move(words_)};
  write_record(path, record);
  words_ = std::move(record.words);
}

TakenPositions TakenPositions::read(const std::filesystem::path& path) {
  TakenPositions taken;
  taken.words_ = std::move(read_record<Words>(path).words);
  if (!std::has_single_bit(taken.words_.size()))
    corrupt("the work file " + path.string() + " is damaged");
  return taken;
}

bool UnitPositions::contains(const Vec3& position) const {
  constexpr uint64_t kSeed = 0x9e3779b97f4a7c15;
  const uint64_t hash = hash_value(position, kSeed);
  const bool is_dealt = (hash & 1) != 0;
  const bool is_own =
      is_dealt ? (hash >> 1) % partition_.units() == unit_ : partition_.home(position) == unit_;
  if (!is_own) return false;
  std::call_once(is_read_, [&] {
    if (fetch_) fetch_();
    taken_ = TakenPositions::read(path_);
  });
  return !taken_.may_contain(position);
}

}  // namespace umbel::scale
