// What one stretch of the source has for each unit: a file with a slice a unit.
//
//   bytes 0..64   magic, floats of a vertex, whether there are materials, slices, where the index
//   is
//                 and its XXH64
//   slices        vertices, triangles of the slice's own vertices, materials, mail
//   index         for each slice, rising by unit: unit, counts, offset, XXH64
//
// Everything is little-endian words.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

#include "base/file.hpp"
#include "scale/slice_places.hpp"
#include "umbel/types.hpp"

namespace umbel::scale {

/// One unit's part of a stretch of the source.
struct RouteSlice {
  std::vector<float> vertices;  ///< rows: the position, then the values of all streams
  std::vector<Triangle> triangles;
  std::vector<uint32_t> materials;  ///< one a triangle, or none
  /// Positions that are at home in this unit, of triangles of other units.
  std::vector<Vec3> mail;
};

/// Writes slices in rising order of their units.
class RouteWriter {
 public:
  RouteWriter(const std::filesystem::path& path, uint32_t floats, bool has_materials);
  void add(uint32_t unit, const RouteSlice& slice);
  /// Writes the index, flushes, and gives the file its name.
  void commit();

 private:
  friend class RouteFile;
  struct Entry {
    uint32_t unit, vertices, triangles, mail;
    uint64_t offset, hash;
  };

  OutputFile file_;
  uint32_t floats_;
  bool has_materials_;
  uint64_t at_;
  std::vector<Entry> index_;
  std::vector<std::byte> bytes_;
};

/// Throws kIo and kCorrupt.
class RouteFile {
 public:
  explicit RouteFile(const std::filesystem::path& path);

  uint32_t floats() const { return floats_; }
  bool has_materials() const { return has_materials_; }
  /// Empty for a unit that the file has nothing for. Checks its bytes.
  RouteSlice read(uint32_t unit) const;
  /// Triangles of a unit, without reading them.
  uint64_t triangles(uint32_t unit) const;
  /// Reads all of it. Throws kCorrupt where a byte has changed.
  void check() const;
  SlicePlaces places() const;

 private:
  const RouteWriter::Entry* find(uint32_t unit) const;
  /// Of a slice, in bytes.
  uint64_t size_of(const RouteWriter::Entry& entry) const;

  std::filesystem::path path_;
  InputFile file_;
  uint32_t floats_ = 0;
  bool has_materials_ = false;
  std::vector<RouteWriter::Entry> index_;
};

/// Whether the file is there, and every byte of it is as it was written.
bool is_whole_route(const std::filesystem::path& path);

}  // namespace umbel::scale
