#include "asset/connectivity.hpp"

#include <algorithm>

namespace umbel::asset {
namespace {

/// Behind the last gate that a cluster can have, and behind the place for what is no gate.
constexpr uint16_t kNoGate = 3 * kMaxLocal + 1;

/// What the third vertex of a gate's triangle is.
enum Apex : uint32_t {
  kNew = 0,      ///< the next number
  kAfter = 1,    ///< the end of an open gate that begins at b
  kBefore = 2,   ///< the beginning of an open gate that ends at a
  kNamed = 3,    ///< its number follows
  kNothing = 4,  ///< there is no triangle after all
};

/// One word of the prefix code: a triangle's apex, and whether its edges (b, c) and (c, a) are
/// gates. Edges that close a gate count as gates here.
struct Symbol {
  uint8_t apex, right, left;
  uint8_t length;  ///< bits
  uint8_t code;    ///< the first bit lowest
};

constexpr uint32_t kLongest = 8;
/// From how often each occurs on scans; complete, so that any bits are words.
constexpr std::array<Symbol, 13> kSymbols{{{kNew, 1, 1, 1, 0b1},
                                           {kAfter, 1, 1, 3, 0b110},
                                           {kBefore, 1, 1, 3, 0b010},
                                           {kNew, 0, 1, 4, 0b1100},
                                           {kNew, 1, 0, 4, 0b0100},
                                           {kNew, 0, 0, 5, 0b11000},
                                           {kAfter, 1, 0, 5, 0b01000},
                                           {kBefore, 0, 1, 5, 0b10000},
                                           {kNamed, 1, 1, 6, 0b100000},
                                           {kNamed, 0, 1, 8, 0b11000000},
                                           {kNamed, 1, 0, 8, 0b01000000},
                                           {kNamed, 0, 0, 8, 0b10000000},
                                           {kNothing, 0, 0, 8, 0b00000000}}};

/// The symbol that any eight bits begin with.
constexpr std::array<Symbol, 1u << kLongest> decoding_table() {
  std::array<Symbol, 1u << kLongest> table{};
  for (uint32_t bits = 0; bits < table.size(); ++bits)
    for (const Symbol& symbol : kSymbols)
      if ((bits & ((1u << symbol.length) - 1)) == symbol.code) table[bits] = symbol;
  return table;
}
constexpr auto kDecodingTable = decoding_table();

/// Where an apex with its two edges is among the symbols; kSymbols.size() where it is not.
constexpr uint32_t place_of(uint32_t apex, bool right, bool left) {
  return 4 * apex + 2 * right + left;
}
constexpr std::array<uint8_t, size_t{4} * kNothing + 4> encoding_table() {
  std::array<uint8_t, size_t{4} * kNothing + 4> table{};
  table.fill(kSymbols.size());
  for (size_t i = 0; i < kSymbols.size(); ++i)
    table[place_of(kSymbols[i].apex, kSymbols[i].right != 0, kSymbols[i].left != 0)] =
        static_cast<uint8_t>(i);
  return table;
}
constexpr auto kEncodingTable = encoding_table();

// Not bytes: those may alias anything, and would keep the decoder's state out of registers.
struct Gate {
  uint16_t a, b, across;
};

Parents parents_of(const Gate& gate) {
  return {static_cast<uint8_t>(gate.a), static_cast<uint8_t>(gate.b),
          static_cast<uint8_t>(gate.across)};
}

/// The gates in the order in which they were opened, and the last open one that begins and that
/// ends at each vertex. First opened, first passed: so the walk grows as a disc, and hardly ever
/// meets itself anywhere but beside a gate.
class Front {
 public:
  Front() {
    from_.fill(kNoGate);
    into_.fill(kNoGate);
    open_.fill(0);
    // No vertex has this number, so that what is asked of no gate is never true.
    gates_[kNoGate] = {0xffff, 0xffff, 0xffff};
  }

  /// The first open gate, closed; false if there is none.
  bool pop(Gate& gate) {
    while (head_ == 0) {
      if (word_ >= count_ / 64) return false;
      head_ = open_[++word_];
    }
    const uint32_t first = 64 * word_ + static_cast<uint32_t>(std::countr_zero(head_));
    head_ &= head_ - 1;
    gate = gates_[first];
    forget(first);
    return true;
  }

  /// Opens a gate, if it is one (1): without a branch, since that is hard to foresee.
  void push(uint32_t a, uint32_t b, uint32_t across, uint32_t is_gate) {
    const auto gate = static_cast<uint16_t>(count_);
    gates_[gate] = {static_cast<uint16_t>(a), static_cast<uint16_t>(b),
                    static_cast<uint16_t>(across)};
    from_[a] = is_gate ? gate : from_[a];
    into_[b] = is_gate ? gate : into_[b];
    const uint64_t bit = uint64_t{is_gate} << (gate % 64);
    open_[gate / 64] |= bit;
    head_ |= gate / 64 == word_ ? bit : 0;
    count_ += is_gate;
  }

  /// Closes an open gate from a to b, if one is known.
  bool close(uint32_t a, uint32_t b) {
    uint32_t gate = from_[a];
    if (gates_[gate].b != b) gate = into_[b];
    if (gates_[gate].a != a) return false;
    const uint64_t bit = uint64_t{1} << (gate % 64);
    open_[gate / 64] &= ~bit;
    head_ &= gate / 64 == word_ ? ~bit : ~uint64_t{0};
    forget(gate);
    return true;
  }

  /// The end of the last open gate that begins at v; 0xffff if none is known.
  uint32_t after(uint32_t v) const { return gates_[from_[v]].b; }
  /// The beginning of the last open gate that ends at v.
  uint32_t before(uint32_t v) const { return gates_[into_[v]].a; }

 private:
  void forget(uint32_t gate) {
    uint16_t& from = from_[gates_[gate].a];
    uint16_t& into = into_[gates_[gate].b];
    from = from == gate ? kNoGate : from;
    into = into == gate ? kNoGate : into;
  }

  // A triangle opens three gates at most.
  std::array<Gate, kNoGate + 1> gates_;
  std::array<uint16_t, kMaxLocal> from_, into_;
  std::array<uint64_t, kNoGate / 64 + 1> open_;
  // The word that the first open gate is in, apart from the others, which then are not waited for.
  uint64_t head_ = 0;
  uint32_t word_ = 0, count_ = 0;
};

/// Directed edges by the vertex that they begin at, with the triangles that have them.
class EdgeTable {
 public:
  struct Edge {
    uint8_t to, across;  ///< the triangle's vertices after the first
    uint8_t triangle;
    bool is_visited;
  };

  EdgeTable(std::span<const uint8_t> triangles, uint32_t vertices) {
    std::fill_n(first_.begin(), vertices + 1, uint16_t{0});
    for (const uint8_t v : triangles) ++first_[v + 1];
    for (uint32_t v = 0; v < vertices; ++v) first_[v + 1] += first_[v];
    std::array<uint16_t, kMaxLocal> next;
    std::copy_n(first_.begin(), vertices, next.begin());
    for (uint32_t at = 0; at < triangles.size(); at += 3)
      for (uint32_t k = 0; k < 3; ++k) {
        const uint16_t place = next[triangles[at + k]]++;
        edges_[place] = {triangles[at + (k + 1) % 3], triangles[at + (k + 2) % 3],
                         static_cast<uint8_t>(at / 3), false};
        places_[at + k] = place;
      }
  }

  /// The first edge (a, b) of a triangle that was not visited, or null.
  const Edge* find(uint8_t a, uint8_t b) const {
    for (uint32_t i = first_[a]; i < first_[a + 1]; ++i)
      if (edges_[i].to == b && !edges_[i].is_visited) return &edges_[i];
    return nullptr;
  }

  void visit(uint32_t triangle) {
    for (uint32_t k = 0; k < 3; ++k) edges_[places_[3 * triangle + k]].is_visited = true;
  }

 private:
  std::array<uint16_t, kMaxLocal + 1> first_;
  std::array<Edge, size_t{3} * kMaxLocal> edges_;
  std::array<uint16_t, size_t{3} * kMaxLocal> places_;  // of each corner's edge
};

class Encoder {
 public:
  Encoder(std::span<const uint8_t> triangles, uint32_t vertices, BitWriter& out)
      : triangles_(triangles), edges_(triangles, vertices), out_(out), vertices_(vertices) {
    left_ = triangles.size() / 3;
    walk_.vertices.reserve(vertices);
    walk_.parents.reserve(vertices);
    walk_.triangles.reserve(triangles.size());
  }

  Walk run() {
    for (uint32_t t = 0; 3 * t < triangles_.size(); ++t)
      if (!visited_[t]) walk_from(t);
    for (uint32_t v = 0; v < vertices_; ++v)
      if (!is_known_[v]) number(static_cast<uint8_t>(v), parents_at_start());
    return std::move(walk_);
  }

 private:
  Parents parents_at_start() const {
    const auto before = static_cast<uint8_t>(std::max<size_t>(walk_.vertices.size(), 1) - 1);
    return {before, before, before};
  }

  uint32_t known() const { return static_cast<uint32_t>(walk_.vertices.size()); }

  void number(uint8_t vertex, Parents parents) {
    numbers_[vertex] = static_cast<uint8_t>(known());
    is_known_[vertex] = true;
    walk_.vertices.push_back(vertex);
    walk_.parents.push_back(parents);
  }

  void visit(uint32_t triangle) {
    visited_[triangle] = true;
    edges_.visit(triangle);
    --left_;
  }

  void walk_from(uint32_t triangle) {
    visit(triangle);
    for (uint32_t k = 0; k < 3; ++k) {
      const uint8_t vertex = triangles_[3 * triangle + k];
      out_.write(is_known_[vertex] ? 0 : 1, 1);
      if (is_known_[vertex])
        out_.write(numbers_[vertex], bits_below(known()));
      else
        number(vertex, parents_at_start());
      walk_.triangles.push_back(numbers_[vertex]);
    }
    const uint8_t a = triangles_[3 * triangle], b = triangles_[3 * triangle + 1],
                  c = triangles_[3 * triangle + 2];
    out_.write(pass_edge(a, b, c), 1);
    out_.write(pass_edge(b, c, a), 1);
    out_.write(pass_edge(c, a, b), 1);
    // Gates are kept in the walk's numbers.
    for (Gate gate; left_ > 0 && front_.pop(gate);) pass_gate(gate);
  }

  void pass_gate(const Gate& gate) {
    const uint8_t a = walk_.vertices[gate.a], b = walk_.vertices[gate.b];
    const EdgeTable::Edge* const edge = edges_.find(a, b);
    if (edge == nullptr) {
      write(kNothing, false, false);
      return;
    }
    visit(edge->triangle);
    const uint8_t c = edge->across;
    const uint32_t apex = apex_of(gate, c), seen = known();
    if (apex == kNew) number(c, parents_of(gate));
    for (const uint32_t v : {uint32_t{gate.a}, uint32_t{gate.b}, uint32_t{numbers_[c]}})
      walk_.triangles.push_back(static_cast<uint8_t>(v));
    const bool right = pass_edge(b, c, a), left = pass_edge(c, a, b);
    if (write(apex, right, left) == kNamed) out_.write(numbers_[c], bits_below(seen));
  }

  uint32_t apex_of(const Gate& gate, uint8_t c) const {
    if (!is_known_[c]) return kNew;
    if (front_.after(gate.b) == numbers_[c]) return kAfter;
    return front_.before(gate.a) == numbers_[c] ? kBefore : kNamed;
  }

  /// Writes the symbol, or that of the same triangle by name where it has none (with edges from a
  /// vertex to itself, a gate beside this one may be gone by the time that it would be closed).
  uint32_t write(uint32_t apex, bool right, bool left) {
    const uint8_t symbol = kEncodingTable[place_of(apex, right, left)];
    if (symbol == kSymbols.size()) return write(kNamed, right, left);
    out_.write(kSymbols[symbol].code, kSymbols[symbol].length);
    return apex;
  }

  /// The edge (a, b) of a triangle with the third vertex c: whether it is or closes a gate.
  bool pass_edge(uint8_t a, uint8_t b, uint8_t c) {
    if (front_.close(numbers_[a], numbers_[b])) return true;
    const bool is_gate = edges_.find(b, a) != nullptr;
    if (is_gate)
      front_.push(numbers_[b], numbers_[a], numbers_[c], 1);
    else
      walk_.border.push_back({numbers_[a], numbers_[b]});
    return is_gate;
  }

  std::span<const uint8_t> triangles_;
  EdgeTable edges_;
  BitWriter& out_;
  uint32_t vertices_;
  std::array<bool, kMaxLocal> visited_{}, is_known_{};
  size_t left_;
  std::array<uint8_t, kMaxLocal> numbers_;
  Walk walk_;
  Front front_;
};

class Decoder {
 public:
  Decoder(const BitReader& in, std::span<uint8_t> triangles, std::span<Parents> parents,
          BorderEdges& border)
      : in_(in), triangles_(triangles), parents_(parents), border_(border) {}

  void run() {
    Gate gate;
    while (at_ < triangles_.size()) {
      if (front_.pop(gate))
        pass_gate(gate);
      else
        start();
    }
    while (known_ < parents_.size()) number_at_start();
  }

  const BitReader& reader() const { return in_; }
  uint32_t border_edges() const { return border_edges_; }

 private:
  uint32_t number(Parents parents) {
    if (known_ >= parents_.size()) corrupt("a cluster's triangles have more vertices than it has");
    parents_[known_] = parents;
    return known_++;
  }

  uint32_t number_at_start() {
    const auto before = static_cast<uint8_t>(std::max(known_, 1u) - 1);
    return number({before, before, before});
  }

  uint32_t named() {
    const uint32_t vertex = in_.take(bits_below(known_));
    if (vertex >= known_)
      corrupt("a triangle has the local vertex " + std::to_string(vertex) + " of " +
              std::to_string(known_));
    return vertex;
  }

  void add(uint32_t a, uint32_t b, uint32_t c) {
    triangles_[at_] = static_cast<uint8_t>(a);
    triangles_[at_ + 1] = static_cast<uint8_t>(b);
    triangles_[at_ + 2] = static_cast<uint8_t>(c);
    at_ += 3;
  }

  void start() {
    in_.refill();
    uint32_t corners[3];
    for (uint32_t& corner : corners) corner = in_.take(1) ? number_at_start() : named();
    const auto [a, b, c] = corners;
    add(a, b, c);
    pass_edge(a, b, c, in_.take(1));
    pass_edge(b, c, a, in_.take(1));
    pass_edge(c, a, b, in_.take(1));
  }

  void pass_gate(const Gate& gate) {
    in_.refill();
    const Symbol symbol = kDecodingTable[in_.peek(kLongest)];
    in_.skip(symbol.length);
    if (symbol.apex == kNew && gate.a != gate.b) {
      const uint32_t c = number(parents_of(gate));
      add(gate.a, gate.b, c);
      // No gate is at a new vertex, so none can be closed.
      open_edge(gate.b, c, gate.a, symbol.right);
      open_edge(c, gate.a, gate.b, symbol.left);
      return;
    }
    if (symbol.apex == kNothing) return;
    const uint32_t c = read_apex(gate, symbol.apex);
    add(gate.a, gate.b, c);
    pass_edge(gate.b, c, gate.a, symbol.right);
    pass_edge(c, gate.a, gate.b, symbol.left);
  }

  uint32_t read_apex(const Gate& gate, uint32_t apex) {
    if (apex == kNew) return number(parents_of(gate));
    if (apex == kNamed) return named();
    const uint32_t c = apex == kAfter ? front_.after(gate.b) : front_.before(gate.a);
    if (c >= kMaxLocal) corrupt("a triangle leans on a gate that is not there");
    return c;
  }

  void pass_edge(uint32_t a, uint32_t b, uint32_t c, uint32_t is_gate) {
    if (!front_.close(a, b)) open_edge(a, b, c, is_gate);
  }

  void open_edge(uint32_t a, uint32_t b, uint32_t c, uint32_t is_gate) {
    front_.push(b, a, c, is_gate);
    border_[border_edges_] = {static_cast<uint8_t>(a), static_cast<uint8_t>(b)};
    border_edges_ += 1 - is_gate;
  }

  BitReader in_;
  std::span<uint8_t> triangles_;
  std::span<Parents> parents_;
  BorderEdges& border_;
  size_t at_ = 0;
  uint32_t known_ = 0, border_edges_ = 0;
  Front front_;
};

}  // namespace

Walk encode_triangles(std::span<const uint8_t> triangles, uint32_t vertices, BitWriter& out) {
  return Encoder(triangles, vertices, out).run();
}

uint32_t decode_triangles(BitReader& in, std::span<uint8_t> triangles, std::span<Parents> parents,
                          BorderEdges& border) {
  Decoder decoder(in, triangles, parents, border);
  decoder.run();
  in = decoder.reader();
  return decoder.border_edges();
}

}  // namespace umbel::asset
