#include "asset/codec/connectivity.hpp"

#include <algorithm>

#include "asset/codec/connectivity_words.hpp"
#include "asset/codec/region_seeds.hpp"

namespace umbel::asset {
namespace {

/// One past the last active edge of a cluster, and one more for closed edges.
constexpr uint16_t kNoEdgeInCluster = 3 * kMaxLocal + 1;

/// Where each symbol is among the words of each code; kWords.size() where it is not.
constexpr std::array<uint8_t, kSymbols> encoding_table() {
  std::array<uint8_t, kSymbols> table{};
  table.fill(kWords.size());
  for (size_t i = 0; i < kWords.size(); ++i) table[kWords[i].symbol] = static_cast<uint8_t>(i);
  return table;
}
constexpr auto kEncodingTable = encoding_table();

struct ActiveEdge {
  uint16_t a, b, across;
  uint16_t edge;  ///< of the triangle behind it, when it was opened
};

/// The queue of active edges, and for each vertex the last open one that starts there and that ends
/// there. First opened, first crossed: the traversal grows as a disc and rarely meets itself
/// anywhere but beside an active edge.
class Front {
 public:
  Front() {
    from_.fill(kNoEdgeInCluster);
    into_.fill(kNoEdgeInCluster);
    open_.fill(0);
    // No vertex has this number, so tests of no active edge fail.
    edges_[kNoEdgeInCluster] = {0xffff, 0xffff, 0xffff, 0xffff};
  }

  /// The first open active edge, closed; false if there is none.
  bool pop(ActiveEdge& active) {
    while (head_ == 0) {
      if (word_ >= count_ / 64) return false;
      head_ = open_[++word_];
    }
    const uint32_t first = 64 * word_ + static_cast<uint32_t>(std::countr_zero(head_));
    head_ &= head_ - 1;
    active = edges_[first];
    forget(first);
    return true;
  }

  void push(const ActiveEdge& active) {
    edges_[count_] = active;
    from_[active.a] = into_[active.b] = static_cast<uint16_t>(count_);
    const uint64_t bit = uint64_t{1} << (count_ % 64);
    open_[count_ / 64] |= bit;
    if (count_ / 64 == word_) head_ |= bit;
    ++count_;
  }

  /// Closes an open active edge from a to b, if one is known.
  bool close(uint32_t a, uint32_t b) {
    uint32_t active = from_[a];
    if (edges_[active].b != b) active = into_[b];
    if (edges_[active].a != a) return false;
    const uint64_t bit = uint64_t{1} << (active % 64);
    open_[active / 64] &= ~bit;
    head_ &= active / 64 == word_ ? ~bit : ~uint64_t{0};
    forget(active);
    return true;
  }

  /// The end of the last open active edge that begins at v; 0xffff if none is known.
  uint32_t after(uint32_t v) const { return edges_[from_[v]].b; }
  /// The beginning of the last open active edge that ends at v.
  uint32_t before(uint32_t v) const { return edges_[into_[v]].a; }

 private:
  void forget(uint32_t active) {
    uint16_t& from = from_[edges_[active].a];
    uint16_t& into = into_[edges_[active].b];
    from = from == active ? kNoEdgeInCluster : from;
    into = into == active ? kNoEdgeInCluster : into;
  }

  // A triangle opens three active edges at most.
  std::array<ActiveEdge, kNoEdgeInCluster + 1> edges_;
  std::array<uint16_t, kMaxLocal> from_, into_;
  std::array<uint64_t, kNoEdgeInCluster / 64 + 1> open_;
  // The word of open_ that has the first open active edge, in a variable of its own: a register.
  uint64_t head_ = 0;
  uint32_t word_ = 0, count_ = 0;
};

/// Directed edges by the vertex that they begin at, with the triangles that have them.
class EdgeTable {
 public:
  static constexpr uint16_t kNoEdge = 0xffff;
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
        const uint16_t edge = next[triangles[at + k]]++;
        edges_[edge] = {triangles[at + (k + 1) % 3], triangles[at + (k + 2) % 3],
                        static_cast<uint8_t>(at / 3), false};
        edge_of_corner_[at + k] = edge;
      }
  }

  /// The first edge (a, b) of a triangle that was not visited, or kNoEdge.
  uint16_t find(uint8_t a, uint8_t b) const { return find(first_[a], a, b); }
  /// The same where no such edge is before `from`.
  uint16_t find(uint16_t from, uint8_t a, uint8_t b) const {
    for (uint16_t i = from; i < first_[a + 1]; ++i)
      if (edges_[i].to == b && !edges_[i].is_visited) return i;
    return kNoEdge;
  }
  const Edge& operator[](uint16_t edge) const { return edges_[edge]; }

  void visit(uint32_t triangle) {
    for (uint32_t k = 0; k < 3; ++k) edges_[edge_of_corner_[3 * triangle + k]].is_visited = true;
  }

 private:
  std::array<uint16_t, kMaxLocal + 1> first_;
  std::array<Edge, size_t{3} * kMaxLocal> edges_;
  std::array<uint16_t, size_t{3} * kMaxLocal> edge_of_corner_;  // of each corner's edge
};

class ConnectivityEncoder {
 public:
  ConnectivityEncoder(std::span<const uint8_t> triangles, uint32_t vertices,
                      std::span<const int32_t> values)
      : triangles_(triangles),
        edges_(triangles, vertices),
        seeds_(triangles, values, vertices),
        vertices_(vertices) {
    left_ = triangles.size() / 3;
    traversal_.vertices.reserve(vertices);
    traversal_.predictors.reserve(vertices);
    traversal_.triangles.reserve(triangles.size());
    codes_.reserve(triangles.size());
  }

  Traversal run(BitWriter& out) {
    if (left_ > 0) traverse_from(RegionSeeds::kFirst);
    while (left_ > 0)
      traverse_from(
          seeds_.next(traversal_.vertices.back(), visited_, is_known_, bits_below(known())));
    for (uint32_t v = 0; v < vertices_; ++v)
      if (!is_known_[v]) number(static_cast<uint8_t>(v), predictors_at_start());
    write_codes(out);
    return std::move(traversal_);
  }

 private:
  /// A number of so many bits, or the place of a word among the words.
  struct Code {
    uint8_t value, bits;
  };
  static constexpr uint8_t kWord = 0xff;  ///< in place of the bits

  Predictors predictors_at_start() const {
    const uint32_t before = std::max(known(), 1u) - 1;
    return predictors_of(before, before, before);
  }

  uint32_t known() const { return static_cast<uint32_t>(traversal_.vertices.size()); }

  void number(uint8_t vertex, Predictors predictors) {
    numbers_[vertex] = static_cast<uint8_t>(known());
    is_known_[vertex] = true;
    traversal_.vertices.push_back(vertex);
    traversal_.predictors.push_back(predictors);
  }

  void visit(uint32_t triangle) {
    visited_[triangle] = true;
    edges_.visit(triangle);
    --left_;
  }

  void traverse_from(const RegionSeeds::Seed& seed) {
    visit(seed.triangle);
    std::array<uint8_t, 3> corners;
    std::rotate_copy(&triangles_[3 * seed.triangle], &triangles_[3 * seed.triangle] + seed.corner,
                     &triangles_[3 * seed.triangle] + 3, corners.begin());
    const auto [a, b, c] = corners;
    // One that is there twice has a number by the second time.
    const bool all_new =
        !is_known_[a] && !is_known_[b] && !is_known_[c] && a != b && b != c && c != a;
    code(all_new, 1);
    for (const uint8_t vertex : corners) {
      if (!all_new) code(is_known_[vertex] ? 0 : 1, 1);
      if (is_known_[vertex])
        code(numbers_[vertex], bits_below(known()));
      else
        number(vertex, predictors_at_start());
      traversal_.triangles.push_back(numbers_[vertex]);
    }
    if (all_new) traversal_.predictors.back().word |= Predictors::kCloses;
    code(pass_edge(a, b, c), 1);
    code(pass_edge(b, c, a), 1);
    code(pass_edge(c, a, b), 1);
    // Active edges are kept in the traversal's numbers.
    for (ActiveEdge active; left_ > 0 && front_.pop(active);) cross(active);
  }

  void cross(const ActiveEdge& active) {
    const uint8_t a = traversal_.vertices[active.a], b = traversal_.vertices[active.b];
    const uint16_t edge = edges_.find(active.edge, a, b);
    if (edge == EdgeTable::kNoEdge) {
      write(kNothing, false, false);
      return;
    }
    visit(edges_[edge].triangle);
    const uint8_t c = edges_[edge].across;
    const uint32_t apex = apex_of(active, c), seen = known();
    if (apex == kNew) number(c, predictors_of(active.a, active.b, active.across));
    for (const uint32_t v : {uint32_t{active.a}, uint32_t{active.b}, uint32_t{numbers_[c]}})
      traversal_.triangles.push_back(static_cast<uint8_t>(v));
    const bool right = pass_edge(b, c, a), left = pass_edge(c, a, b);
    if (write(apex, right, left) == kNamed) code(numbers_[c], bits_below(seen));
  }

  uint32_t apex_of(const ActiveEdge& active, uint8_t c) const {
    if (!is_known_[c]) return kNew;
    if (front_.after(active.b) == numbers_[c]) return kAfter;
    return front_.before(active.a) == numbers_[c] ? kBefore : kNamed;
  }

  /// Writes the symbol; where it has no code, that of the same triangle with a named vertex. (With
  /// an edge from a vertex to itself, the active edge beside this one may already be closed.)
  uint32_t write(uint32_t apex, bool right, bool left) {
    const uint8_t word = kEncodingTable[symbol(apex, right, left)];
    if (word == kWords.size()) return write(kNamed, right, left);
    codes_.push_back({word, kWord});
    return apex;
  }

  /// A number of so many bits.
  void code(uint32_t value, uint32_t bits) {
    codes_.push_back({static_cast<uint8_t>(value), static_cast<uint8_t>(bits)});
  }

  /// Writes all of it, with the words that take fewer bits.
  void write_codes(BitWriter& out) const {
    uint32_t bits = 0, of_border = 0;
    for (const Code& c : codes_)
      if (c.bits == kWord) {
        bits += kWords[c.value].length;
        of_border += kBorderWords[c.value].length;
      }
    const Words& words = of_border < bits ? kBorderWords : kWords;
    out.write(of_border < bits, 1);
    for (const Code& c : codes_)
      if (c.bits == kWord)
        out.write(words[c.value].code, words[c.value].length);
      else
        out.write(c.value, c.bits);
  }

  /// Passes the edge (a, b) opposite to c; true if it becomes or closes an active edge.
  bool pass_edge(uint8_t a, uint8_t b, uint8_t c) {
    if (front_.close(numbers_[a], numbers_[b])) return true;
    const uint16_t edge = edges_.find(b, a);
    const bool is_active = edge != EdgeTable::kNoEdge;
    if (is_active)
      front_.push({numbers_[b], numbers_[a], numbers_[c], edge});
    else
      traversal_.border.push_back({numbers_[a], numbers_[b]});
    return is_active;
  }

  std::span<const uint8_t> triangles_;
  EdgeTable edges_;
  RegionSeeds seeds_;
  uint32_t vertices_;
  std::array<bool, kMaxLocal> visited_{}, is_known_{};
  size_t left_;
  std::array<uint8_t, kMaxLocal> numbers_;
  Traversal traversal_;
  std::vector<Code> codes_;  ///< what is written in the end
  Front front_;
};

}  // namespace

Traversal encode_triangles(std::span<const uint8_t> triangles, uint32_t vertices,
                           std::span<const int32_t> values, BitWriter& out) {
  return ConnectivityEncoder(triangles, vertices, values).run(out);
}

}  // namespace umbel::asset
