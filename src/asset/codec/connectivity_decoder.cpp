// Reads what connectivity.cpp writes. What takes the time is which word comes next, which no
// processor foresees; so that is found out once for each triangle, by one jump to code that does
// what this word asks for and no more, and all that changes from triangle to triangle is local.
#include <cstring>

#include "asset/codec/connectivity.hpp"
#include "asset/codec/connectivity_words.hpp"

// Functions that were called would keep the walk's state in memory.
#define UMBEL_INLINE __attribute__((always_inline))

namespace umbel::asset {
namespace {

struct Decoding {
  uint8_t symbol, length;
};

/// The word that any eight bits begin with.
constexpr std::array<Decoding, 1u << kLongestWord> decoding_table() {
  std::array<Decoding, 1u << kLongestWord> table{};
  for (uint32_t bits = 0; bits < table.size(); ++bits)
    for (const Word& word : kWords)
      if ((bits & ((1u << word.length) - 1)) == word.code) table[bits] = {word.symbol, word.length};
  return table;
}
constexpr auto kDecodingTable = decoding_table();

constexpr uint32_t kMostGates = 3 * kMaxLocal;  // a triangle opens three at most
constexpr uint16_t kNoGate = kMostGates + 2;

/// A gate is a word: a, b and across from the lowest byte on. What is no gate, or is closed, begins
/// and ends at a vertex that there is none of.
constexpr uint32_t kNowhere = 0xff000000;
constexpr uint32_t gate_of(uint32_t a, uint32_t b, uint32_t across) {
  return a | b << 8 | across << 16;
}
constexpr uint32_t begin_of(uint32_t gate) { return gate & 0xff0000ff; }
constexpr uint32_t end_of(uint32_t gate) { return gate >> 8 & 0xff00ff; }

/// Gates as they are opened form a list, from which those are taken that are closed.
struct List {
  std::array<uint16_t, kMostGates + 2> next, previous;
};
constexpr List list_of_all() {
  List list{};
  for (uint16_t i = 0; i < kMostGates + 2; ++i) {
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
[[noreturn]] void no_such_gate() { corrupt("a triangle leans on a gate that is not there"); }

}  // namespace

void decode_triangles(BitReader& reader, std::span<uint8_t> triangles, std::span<Parents> parents,
                      BorderLinks border) {
  const auto vertices = static_cast<uint32_t>(parents.size());
  const auto end = static_cast<uint32_t>(triangles.size());
  BitReader in = reader;
  // The gates in the order in which they are opened, the list of those that are open, and the last
  // one that was opened that begins and that ends at each vertex.
  std::array<uint32_t, kNoGate + 1> gates;
  List list;
  std::array<uint16_t, kMaxLocal> from, into;
  gates[kNoGate] = kNowhere;
  std::copy_n(kAll.next.begin(), end + 2, list.next.begin());
  std::copy_n(kAll.previous.begin(), end + 2, list.previous.begin());
  uint32_t first = 0, count = 0;  // the list begins at the one and ends before the other

  // Each triangle is written as four bytes.
  std::array<uint8_t, size_t{3} * kMaxLocal + 1> corners;
  uint32_t at = 0, known = 0;

  const auto new_vertex = [&](uint32_t gate) UMBEL_INLINE {
    if (known >= vertices) too_many_vertices();
    parents[known].word = gate;
    return known++;
  };
  const auto new_after_last = [&]() UMBEL_INLINE {
    const uint32_t before = known - (known > 0);
    const uint32_t vertex = new_vertex(gate_of(before, before, before));
    from[vertex] = into[vertex] = kNoGate;
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
  const auto open_gate = [&](uint32_t a, uint32_t b, uint32_t across) UMBEL_INLINE {
    gates[count] = gate_of(a, b, across);
    from[a] = into[b] = static_cast<uint16_t>(count);
    ++count;
  };
  const auto close_gate = [&](uint32_t gate) UMBEL_INLINE {
    gates[gate] = kNowhere;
    const uint16_t next = list.next[gate], previous = list.previous[gate];
    list.next[previous] = next;
    list.previous[next] = previous;
    first = gate == first ? next : first;
  };
  const auto pass_edge = [&](uint32_t a, uint32_t b, uint32_t c, bool is_gate) UMBEL_INLINE {
    uint32_t gate = from[a];
    gate = end_of(gates[gate]) == b ? gate : into[b];
    if (begin_of(gates[gate]) == a)
      close_gate(gate);
    else if (is_gate)
      open_gate(b, a, c);
    else
      add_border(a, b);
  };
  const auto start = [&]() UMBEL_INLINE {
    in.refill();
    uint32_t v[3];
    for (uint32_t& corner : v) corner = in.take(1) ? new_after_last() : named();
    add(v[0] | v[1] << 8, v[2]);
    for (uint32_t k = 0; k < 3; ++k)
      pass_edge(v[k], v[(k + 1) % 3], v[(k + 2) % 3], in.take(1) != 0);
  };

  while (at < end) {
    if (first == count) {
      start();
      continue;
    }
    const uint32_t gate = gates[first], a = gate & 0xff, b = gate >> 8 & 0xff;
    gates[first] = kNowhere;
    first = list.next[first];
    in.ensure(kLongestWord + 8);  // and a vertex
    const Decoding decoding = kDecodingTable[in.peek(kLongestWord)];
    in.skip(decoding.length);
    const auto new_apex = [&](bool right, bool left) UMBEL_INLINE {
      const uint32_t c = new_vertex(gate);
      if (!right || a == b) from[c] = kNoGate;
      if (!left || a == b) into[c] = kNoGate;
      add(gate & 0xffff, c);
      if (a == b) [[unlikely]] {
        pass_edge(b, c, a, right);
        pass_edge(c, a, b, left);
        return;
      }
      // No gate is at a new vertex, so none can be closed.
      if (right)
        open_gate(c, b, a);
      else
        add_border(b, c);
      if (left)
        open_gate(a, c, b);
      else
        add_border(c, a);
    };
    const auto old_apex = [&](uint32_t c, bool right, bool left) UMBEL_INLINE {
      add(gate & 0xffff, c);
      pass_edge(b, c, a, right);
      pass_edge(c, a, b, left);
    };
    const auto after = [&](bool left) UMBEL_INLINE {
      const uint32_t beside = from[b], c = end_of(gates[beside]);
      if (c >= kMaxLocal) no_such_gate();
      add(gate & 0xffff, c);
      close_gate(beside);
      pass_edge(c, a, b, left);
    };
    const auto before = [&](bool right) UMBEL_INLINE {
      const uint32_t c = begin_of(gates[into[a]]);
      if (c >= kMaxLocal) no_such_gate();
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
  while (known < vertices) new_after_last();
  if (end > 0) std::memcpy(triangles.data(), corners.data(), end);
  reader = in;
}

}  // namespace umbel::asset
