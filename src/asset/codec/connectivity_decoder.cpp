// Decodes what connectivity.cpp writes. The branch on the next code word is unpredictable and takes
// most of the time, so each triangle has one: a jump to code specialised for its symbol. All state
// is local, in registers.
#include <cstring>

#include "asset/codec/connectivity.hpp"
#include "asset/codec/connectivity_words.hpp"

// A call would spill the traversal's state to memory.
#define UMBEL_INLINE __attribute__((always_inline))

namespace umbel::asset {
namespace {

struct Decoding {
  uint8_t symbol, length;
};

/// The word that any eight bits begin with.
using DecodingTable = std::array<Decoding, 1u << kLongestWord>;
constexpr DecodingTable decoding_table(const Words& words) {
  DecodingTable table{};
  for (uint32_t bits = 0; bits < table.size(); ++bits)
    for (const Word& word : words)
      if ((bits & ((1u << word.length) - 1)) == word.code) table[bits] = {word.symbol, word.length};
  return table;
}
constexpr std::array kDecodingTables{decoding_table(kWords), decoding_table(kBorderWords)};

constexpr uint32_t kMaxActiveEdges = 3 * kMaxLocal;  // a triangle opens three at most
constexpr uint16_t kNoActiveEdge = kMaxActiveEdges + 2;

/// An active edge is a word: a, b and across from the lowest byte on. A closed edge starts and ends
/// at a vertex number that does not exist.
constexpr uint32_t kNowhere = 0xff000000;
constexpr uint32_t active_edge(uint32_t a, uint32_t b, uint32_t across) {
  return a | b << 8 | across << 16;
}
constexpr uint32_t begin_of(uint32_t active) { return active & 0xff0000ff; }
constexpr uint32_t end_of(uint32_t active) { return active >> 8 & 0xff00ff; }

/// The queue of active edges: a linked list in the order of opening, without those that are closed.
struct List {
  std::array<uint16_t, kMaxActiveEdges + 2> next, previous;
};
constexpr List list_of_all() {
  List list{};
  for (uint16_t i = 0; i < kMaxActiveEdges + 2; ++i) {
    list.next[i] = i + 1;
    list.previous[i] = static_cast<uint16_t>(i - (i > 0));
  }
  return list;
}
constexpr List kAll = list_of_all();

[[noreturn]] void too_many_vertices() {
  corrupt("a cluster's triangles have more vertices than it has");
}
[[noreturn]] void no_such_vertex(uint32_t vertex, uint32_t known) {
  corrupt("a triangle has the local vertex " + std::to_string(vertex) + " of " +
          std::to_string(known));
}
[[noreturn]] void no_such_edge() {
  corrupt("a triangle refers to an active edge that is not there");
}

}  // namespace

// Over 60 lines: the lambdas share local state that a struct would keep in memory.
void decode_triangles(uint32_t version, BitReader& reader, std::span<uint8_t> triangles,
                      std::span<Predictors> predictors, BorderLinks border) {
  const auto vertices = static_cast<uint32_t>(predictors.size());
  const auto end = static_cast<uint32_t>(triangles.size());
  BitReader in = reader;
  const bool has_codes = version > 5;
  const DecodingTable& words = kDecodingTables[has_codes ? in.read(1) : 0];
  // All active edges in the order of opening, the list of open ones, and for each vertex the last
  // one opened that starts there and that ends there.
  std::array<uint32_t, kNoActiveEdge + 1> edges;
  List list;
  std::array<uint16_t, kMaxLocal> from, into;
  edges[kNoActiveEdge] = kNowhere;
  std::copy_n(kAll.next.begin(), end + 2, list.next.begin());
  std::copy_n(kAll.previous.begin(), end + 2, list.previous.begin());
  uint32_t first = 0, count = 0;  // the list begins at the one and ends before the other

  // Each triangle is written as four bytes.
  std::array<uint8_t, size_t{3} * kMaxLocal + 1> corners;
  uint32_t at = 0, known = 0;

  const auto new_vertex = [&](uint32_t active) UMBEL_INLINE {
    if (known >= vertices) too_many_vertices();
    predictors[known].word = active;
    return known++;
  };
  const auto new_after_last = [&](uint32_t mark) UMBEL_INLINE {
    const uint32_t before = known - (known > 0);
    const uint32_t vertex = new_vertex(active_edge(before, before, before) | mark);
    from[vertex] = into[vertex] = kNoActiveEdge;
    return vertex;
  };
  const auto named = [&]() UMBEL_INLINE {
    const uint32_t vertex = in.take(bits_below(known));
    if (vertex >= known) no_such_vertex(vertex, known);
    return vertex;
  };
  const auto add = [&](uint32_t a_and_b, uint32_t c) UMBEL_INLINE {
    const uint32_t bytes = little_endian(a_and_b | c << 16);
    std::memcpy(&corners[at], &bytes, 4);
    at += 3;
  };
  const auto add_border = [&](uint32_t a, uint32_t b) UMBEL_INLINE {
    border.next[a] = border.first + b;
    border.previous[b] = border.first + a;
  };
  const auto open_edge = [&](uint32_t a, uint32_t b, uint32_t across) UMBEL_INLINE {
    edges[count] = active_edge(a, b, across);
    from[a] = into[b] = static_cast<uint16_t>(count);
    ++count;
  };
  const auto close_edge = [&](uint32_t active) UMBEL_INLINE {
    edges[active] = kNowhere;
    const uint16_t next = list.next[active], previous = list.previous[active];
    list.next[previous] = next;
    list.previous[next] = previous;
    first = active == first ? next : first;
  };
  const auto pass_edge = [&](uint32_t a, uint32_t b, uint32_t c, bool is_active) UMBEL_INLINE {
    uint32_t active = from[a];
    active = end_of(edges[active]) == b ? active : into[b];
    if (begin_of(edges[active]) == a)
      close_edge(active);
    else if (is_active)
      open_edge(b, a, c);
    else
      add_border(a, b);
  };
  const auto start = [&]() UMBEL_INLINE {
    in.refill();
    uint32_t v[3];
    if (has_codes && in.take(1)) {
      for (uint32_t k = 0; k < 3; ++k) v[k] = new_after_last(k == 2 ? Predictors::kCloses : 0);
    } else {
      for (uint32_t& corner : v) corner = in.take(1) ? new_after_last(0) : named();
    }
    add(v[0] | v[1] << 8, v[2]);
    for (uint32_t k = 0; k < 3; ++k)
      pass_edge(v[k], v[(k + 1) % 3], v[(k + 2) % 3], in.take(1) != 0);
  };

  while (at < end) {
    if (first == count) {
      start();
      continue;
    }
    const uint32_t active = edges[first], a = active & 0xff, b = active >> 8 & 0xff;
    edges[first] = kNowhere;
    first = list.next[first];
    in.ensure(kLongestWord + 8);  // and a vertex
    const Decoding decoding = words[in.peek(kLongestWord)];
    in.skip(decoding.length);
    const auto new_apex = [&](bool right, bool left) UMBEL_INLINE {
      const uint32_t c = new_vertex(active);
      if (!right || a == b) from[c] = kNoActiveEdge;
      if (!left || a == b) into[c] = kNoActiveEdge;
      add(active & 0xffff, c);
      if (a == b) [[unlikely]] {
        pass_edge(b, c, a, right);
        pass_edge(c, a, b, left);
        return;
      }
      // No active edge is at a new vertex, so none can be closed.
      if (right)
        open_edge(c, b, a);
      else
        add_border(b, c);
      if (left)
        open_edge(a, c, b);
      else
        add_border(c, a);
    };
    const auto old_apex = [&](uint32_t c, bool right, bool left) UMBEL_INLINE {
      add(active & 0xffff, c);
      pass_edge(b, c, a, right);
      pass_edge(c, a, b, left);
    };
    const auto after = [&](bool left) UMBEL_INLINE {
      const uint32_t beside = from[b], c = end_of(edges[beside]);
      if (c >= kMaxLocal) no_such_edge();
      add(active & 0xffff, c);
      close_edge(beside);
      pass_edge(c, a, b, left);
    };
    const auto before = [&](bool right) UMBEL_INLINE {
      const uint32_t c = begin_of(edges[into[a]]);
      if (c >= kMaxLocal) no_such_edge();
      old_apex(c, right, true);
    };
    switch (decoding.symbol) {
      case symbol(kNew, true, true):
        new_apex(true, true);
        break;
      case symbol(kAfter, true, true):
        after(true);
        break;
      case symbol(kBefore, true, true):
        before(true);
        break;
      case symbol(kNew, false, true):
        new_apex(false, true);
        break;
      case symbol(kNew, true, false):
        new_apex(true, false);
        break;
      case symbol(kNew, false, false):
        new_apex(false, false);
        break;
      case symbol(kAfter, true, false):
        after(false);
        break;
      case symbol(kBefore, false, true):
        before(false);
        break;
      case symbol(kNothing, false, false):
        break;
      default:
        old_apex(named(), (decoding.symbol & 2) != 0, (decoding.symbol & 1) != 0);
        break;
    }
  }
  while (known < vertices) new_after_last(0);
  if (end > 0) std::memcpy(triangles.data(), corners.data(), end);
  reader = in;
}

}  // namespace umbel::asset
