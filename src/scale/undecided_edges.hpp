// Edges whose sides are in several units, brought together through files.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

#include "scale/exits.hpp"

namespace umbel::scale {

class UndecidedEdges {
 public:
  /// For so many edges in all. Where those are more than `most`, they go through files of a folder
  /// that is made for them, each with the edges of one remainder of their hash.
  UndecidedEdges(std::filesystem::path folder, uint64_t edges, uint64_t most = uint64_t{1} << 21);
  UndecidedEdges(const UndecidedEdges&) = delete;
  /// Removes the folder.
  ~UndecidedEdges();

  void add(std::span<const PositionEdge> edges);
  /// Those that are not manifold, of all sides together (route_exits.hpp). In an order that depends
  /// on the edges alone. Once.
  std::vector<PositionEdge> non_manifold();

 private:
  std::filesystem::path file(size_t bucket) const;
  void write(size_t bucket);

  std::filesystem::path folder_;
  std::vector<std::vector<PositionEdge>> buckets_;
};

}  // namespace umbel::scale
