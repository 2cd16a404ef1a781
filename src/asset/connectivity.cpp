#include "asset/connectivity.hpp"

#include <algorithm>

namespace umbel::asset {
namespace {

constexpr uint32_t kMaxVertices = 256;
constexpr uint16_t kNoGate = 0xffff;

/// How a gate's third vertex is named: by so many zeros before a one.
enum Apex : uint32_t {
  kNew = 0,      ///< the next number
  kAfter = 1,    ///< the end of an open gate that begins at b
  kBefore = 2,   ///< the beginning of an open gate that ends at a
  kNamed = 3,    ///< its number follows
  kNothing = 4,  ///< there is no triangle after all; four zeros and no one
};

// Not bytes: those may alias anything, and would keep the decoder's state out of registers.
struct Gate {
  uint16_t a, b, across;
  uint16_t open;
};

Parents parents_of(const Gate& gate) {
  return {static_cast<uint8_t>(gate.a), static_cast<uint8_t>(gate.b),
          static_cast<uint8_t>(gate.across)};
}

/// Bits of a number below `count`.
uint32_t bits_below(uint32_t count) { return count < 2 ? 0 : uint32_t(std::bit_width(count - 1)); }

/// The gates in the order in which they were opened, and the last open one that begins and that
/// ends at each vertex. First opened, first passed: so the walk grows as a disc, and hardly ever
/// meets itself anywhere but beside a gate.
class Front {
 public:
  Front() {
    from_.fill(kNoGate);
    into_.fill(kNoGate);
  }

  /// The first open gate, closed; false if there is none.
  bool pop(Gate& gate) {
    while (first_ < count_) {
      gate = gates_[first_++];
      if (!gate.open) continue;
      forget(static_cast<uint16_t>(first_ - 1));
      return true;
    }
    return false;
  }

  void push(uint32_t a, uint32_t b, uint32_t across) {
    from_[a] = into_[b] = static_cast<uint16_t>(count_);
    gates_[count_++] = {static_cast<uint16_t>(a), static_cast<uint16_t>(b),
                        static_cast<uint16_t>(across), 1};
  }

  /// Closes an open gate from a to b, if there is one.
  bool close(uint32_t a, uint32_t b) {
    uint16_t gate = from_[a];
    if (gate == kNoGate || gates_[gate].b != b) gate = into_[b];
    if (gate == kNoGate || gates_[gate].a != a) return false;
    gates_[gate].open = 0;
    forget(gate);
    return true;
  }

  /// The end of an open gate that begins at v; -1 if none is known.
  int after(uint32_t v) const { return from_[v] == kNoGate ? -1 : gates_[from_[v]].b; }
  /// The beginning of an open gate that ends at v.
  int before(uint32_t v) const { return into_[v] == kNoGate ? -1 : gates_[into_[v]].a; }

 private:
  void forget(uint16_t gate) {
    uint16_t& from = from_[gates_[gate].a];
    uint16_t& into = into_[gates_[gate].b];
    if (from == gate) from = kNoGate;
    if (into == gate) into = kNoGate;
  }

  // A triangle opens three gates at most.
  std::array<Gate, 3 * kMaxVertices> gates_;
  std::array<uint16_t, kMaxVertices> from_, into_;
  uint32_t first_ = 0, count_ = 0;
};

/// Triangles by their directed edges.
class EdgeTable {
 public:
  EdgeTable(std::span<const uint8_t> triangles, uint32_t vertices)
      : triangles_(triangles), first_(vertices + 1), corners_(triangles.size()) {
    for (const uint8_t v : triangles) ++first_[v + 1];
    for (uint32_t v = 0; v < vertices; ++v) first_[v + 1] += first_[v];
    std::vector<uint32_t> next(first_.begin(), first_.end() - 1);
    for (uint32_t corner = 0; corner < triangles.size(); ++corner)
      corners_[next[triangles[corner]]++] = corner;
  }

  /// The first corner from which the edge (a, b) goes out in a triangle that was not visited, or
  /// kNone.
  uint32_t find(uint8_t a, uint8_t b, const std::vector<bool>& visited) const {
    for (uint32_t i = first_[a]; i < first_[a + 1]; ++i) {
      const uint32_t corner = corners_[i];
      if (triangles_[turned(corner, 1)] == b && !visited[corner / 3]) return corner;
    }
    return kNone;
  }

  static uint32_t turned(uint32_t corner, uint32_t by) {
    return corner / 3 * 3 + (corner % 3 + by) % 3;
  }

 private:
  std::span<const uint8_t> triangles_;
  std::vector<uint32_t> first_, corners_;
};

class Encoder {
 public:
  Encoder(std::span<const uint8_t> triangles, uint32_t vertices, BitWriter& out)
      : triangles_(triangles), edges_(triangles, vertices), out_(out), is_known_(vertices) {
    numbers_.resize(vertices);
    visited_.resize(triangles.size() / 3);
    left_ = visited_.size();
  }

  Walk run() {
    for (uint32_t t = 0; t < visited_.size(); ++t)
      if (!visited_[t]) walk_from(t);
    for (uint32_t v = 0; v < is_known_.size(); ++v)
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
    pass_edge(a, b, c);
    pass_edge(b, c, a);
    pass_edge(c, a, b);
    // Gates are kept in the walk's numbers.
    for (Gate gate; left_ > 0 && front_.pop(gate);) pass_gate(gate);
  }

  void pass_gate(const Gate& gate) {
    const uint8_t a = walk_.vertices[gate.a], b = walk_.vertices[gate.b];
    const uint32_t corner = edges_.find(a, b, visited_);
    if (corner == kNone) {
      out_.write(0, kNothing);
      return;
    }
    visit(corner / 3);
    const uint8_t c = triangles_[EdgeTable::turned(corner, 2)];
    write_apex(gate, c);
    for (const uint32_t v : {uint32_t{gate.a}, uint32_t{gate.b}, uint32_t{numbers_[c]}})
      walk_.triangles.push_back(static_cast<uint8_t>(v));
    pass_edge(b, c, a);
    pass_edge(c, a, b);
  }

  void write_apex(const Gate& gate, uint8_t c) {
    if (!is_known_[c]) {
      out_.write(1, 1);
      number(c, parents_of(gate));
    } else if (front_.after(gate.b) == numbers_[c]) {
      out_.write(2, 2);
    } else if (front_.before(gate.a) == numbers_[c]) {
      out_.write(4, 3);
    } else {
      out_.write(8, 4);
      out_.write(numbers_[c], bits_below(known()));
    }
  }

  /// The edge (a, b) of a triangle with the third vertex c.
  void pass_edge(uint8_t a, uint8_t b, uint8_t c) {
    if (front_.close(numbers_[a], numbers_[b])) return;
    const bool is_gate = edges_.find(b, a, visited_) != kNone;
    out_.write(is_gate, 1);
    if (is_gate) front_.push(numbers_[b], numbers_[a], numbers_[c]);
  }

  std::span<const uint8_t> triangles_;
  EdgeTable edges_;
  BitWriter& out_;
  std::vector<bool> visited_, is_known_;
  size_t left_;
  std::vector<uint8_t> numbers_;
  Walk walk_;
  Front front_;
};

class Decoder {
 public:
  Decoder(const BitReader& in, std::span<uint8_t> triangles, std::span<Parents> parents)
      : in_(in), triangles_(triangles), parents_(parents) {}

  /// Returns the reader behind what was read.
  BitReader run() {
    Gate gate;
    while (at_ < triangles_.size()) {
      if (front_.pop(gate))
        pass_gate(gate);
      else
        start();
    }
    while (known_ < parents_.size()) number_at_start();
    return in_;
  }

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
    pass_edge(a, b, c);
    pass_edge(b, c, a);
    pass_edge(c, a, b);
  }

  void pass_gate(const Gate& gate) {
    in_.refill();
    const uint32_t apex = in_.take_zeros(kNothing);
    if (apex == kNothing) return;
    const uint32_t c = read_apex(gate, apex);
    add(gate.a, gate.b, c);
    pass_edge(gate.b, c, gate.a);
    pass_edge(c, gate.a, gate.b);
  }

  uint32_t read_apex(const Gate& gate, uint32_t apex) {
    if (apex == kNew) return number(parents_of(gate));
    if (apex == kNamed) return named();
    const int c = apex == kAfter ? front_.after(gate.b) : front_.before(gate.a);
    if (c < 0) corrupt("a triangle leans on a gate that is not there");
    return static_cast<uint32_t>(c);
  }

  void pass_edge(uint32_t a, uint32_t b, uint32_t c) {
    if (!front_.close(a, b) && in_.take(1)) front_.push(b, a, c);
  }

  BitReader in_;
  std::span<uint8_t> triangles_;
  std::span<Parents> parents_;
  size_t at_ = 0;
  uint32_t known_ = 0;
  Front front_;
};

}  // namespace

Walk encode_triangles(std::span<const uint8_t> triangles, uint32_t vertices, BitWriter& out) {
  return Encoder(triangles, vertices, out).run();
}

void decode_triangles(BitReader& in, std::span<uint8_t> triangles, std::span<Parents> parents) {
  in = Decoder(in, triangles, parents).run();
}

}  // namespace umbel::asset
