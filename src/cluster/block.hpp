// Bisection of one set of items that fits a cache, depth-first, by one thread.
//
// Items are sorted once an axis by centroid; splits keep the three orders sorted by stable
// partition. Every legal position of every axis is a candidate.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "cluster/box_record.hpp"
#include "cluster/cut.hpp"
#include "cluster/rules.hpp"
#include "cluster/source.hpp"
#include "cluster/vertex_table.hpp"

namespace umbel::cluster {

class Block {
 public:
  /// Rearranges items[0, count) into cluster order and sets first[i] to 1 where a cluster
  /// starts, 0 elsewhere.
  void bisect(const Source& source, const Rules& rules, uint32_t* items, uint8_t* first,
              uint32_t count);

 private:
  struct Split {
    float cost;
    uint32_t position = 0;  ///< items on the left; 0: none found
    int axis = 0;
  };

  void load(uint32_t count);
  void sort_axis(int axis, uint32_t count);
  void split(uint32_t begin, uint32_t end, uint32_t depth);
  bool is_leaf(uint32_t begin, uint32_t end);
  void make_leaf(uint32_t begin, uint32_t end, int axis);
  Split median(uint32_t begin, uint32_t end) const;
  Split cheapest(uint32_t begin, uint32_t end);
  void sweep(uint32_t begin, uint32_t end, int axis, bool vertex_bound, Split& best);
  void add_overlap(const uint32_t* order, uint32_t n);
  void weigh_vertices(const uint32_t* order, uint32_t n);
  void partition(uint32_t begin, uint32_t end, const Split& split);
  uint32_t count_vertices(uint32_t begin, uint32_t end);
  void number_vertices(uint32_t begin, uint32_t end);

  const Source* source_ = nullptr;
  const Rules* rules_ = nullptr;
  uint32_t* items_ = nullptr;
  uint8_t* first_ = nullptr;
  float pad_ = 0.0f;

  std::vector<uint32_t> ids_;           ///< item of each local index
  std::vector<BoxRecord> boxes_;        ///< by local index
  std::array<std::vector<uint32_t>, 3> orders_;
  std::vector<uint32_t> spare_;
  std::vector<uint8_t> right_;          ///< by local index: on the right of the split
  std::vector<float> left_area_, right_area_, extra_;
  std::vector<float> left_weight_, right_weight_;
  std::vector<BoxRecord> left_boxes_;
  std::vector<uint64_t> words_, spare_words_;
  VertexTable table_;
  std::vector<uint32_t> numbers_;       ///< of the vertices of a vertex-bound node
  std::vector<uint8_t> seen_;
  Cut cut_;
};

}  // namespace umbel::cluster
