// Positions that any unit has or ever had. What a unit makes anew must not be among them: two that
// are equal would be one, and edges between such be shared by what has nothing to do with each
// other.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <mutex>
#include <span>
#include <utility>
#include <vector>

#include "lod/dag/unused_positions.hpp"
#include "scale/partition.hpp"

namespace umbel::scale {

/// A set of positions, of at most a byte a triangle, 64 MB or a quarter byte. It says of some
/// others, too, that they are in it: who looks for a place then takes the next.
class TakenPositions {
 public:
  TakenPositions() = default;
  /// Room for a mesh of so many triangles.
  explicit TakenPositions(uint64_t triangles);
  static uint64_t bytes(uint64_t triangles);

  void add(std::span<const Vec3> positions);
  bool may_contain(const Vec3& position) const;

  void write(const std::filesystem::path& path);
  static TakenPositions read(const std::filesystem::path& path);

 private:
  uint64_t bit_of(const Vec3& position) const;
  std::vector<uint64_t> words_;  // a power of two
};

/// What one unit may use of all that is not taken. Where it is at home: half of all positions, by
/// their bits. The other half is dealt out among all units, wherever they are.
class UnitPositions final : public lod::UnusedPositions {
 public:
  /// `taken`: the file of the tier, read once it is needed, and fetched before, where `fetch` is
  /// set. The partition must live longer.
  UnitPositions(const Partition& partition, uint32_t unit, std::filesystem::path taken,
                std::function<void()> fetch = {})
      : partition_(partition), unit_(unit), path_(std::move(taken)), fetch_(std::move(fetch)) {}

  bool contains(const Vec3& position) const override;

 private:
  const Partition& partition_;
  uint32_t unit_;
  std::filesystem::path path_;
  std::function<void()> fetch_;
  mutable std::once_flag is_read_;
  mutable TakenPositions taken_;
};

}  // namespace umbel::scale
