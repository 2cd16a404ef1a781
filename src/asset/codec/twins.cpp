#include "asset/codec/twins.hpp"

#include <algorithm>
#include <array>
#include <utility>

namespace umbel::asset {
namespace {

/// How many vertices at a position are tried, and how far is looked along their borders: more make
/// no file smaller.
constexpr uint32_t kMostTried = 16, kMostPassed = 64;

/// Calls `step` with the later and the earlier of two vertices, while it is true, from behind `v`
/// and `u` on: along their borders, which run in opposite directions.
template <typename Step>
void follow_twins(const GroupBorders& borders, uint32_t v, uint32_t u, bool forward,
                  const Step& step) {
  while (true) {
    v = forward ? borders.next(v) : borders.previous(v);
    u = forward ? borders.previous(u) : borders.next(u);
    if (v == kNone || u == kNone || v == u || !step(std::max(v, u), std::min(v, u))) return;
  }
}

/// Finds and codes the twins of one cluster.
class ClusterTwins {
 public:
  ClusterTwins(const GroupBorders& borders, std::span<const uint32_t> equal,
               std::span<const int32_t> group, uint32_t stride, std::vector<uint32_t>& heads,
               std::vector<uint32_t>& next_with_hash)
      : borders_(borders),
        equal_(equal),
        group_(group),
        stride_(stride),
        heads_(heads),
        next_with_hash_(next_with_hash),
        twin_(equal.size(), kNone) {}

  std::vector<uint32_t> encode(BitWriter& out) {
    const std::span<const uint32_t> mine = borders_.last();
    for (uint32_t i = 0; i < mine.size(); ++i) {
      if (!is_known(mine[i])) add(i);
      const uint32_t slot = slot_of(mine[i]);
      next_with_hash_[mine[i]] = heads_[slot];
      heads_[slot] = mine[i];
    }
    const bool any = std::ranges::any_of(twin_, [](uint32_t twin) { return twin != kNone; });
    out.write(any, 1);
    if (!any) return std::move(twin_);
    for (const auto& [value, bits] : words_) out.write(value, bits);
    return std::move(twin_);
  }

 private:
  const int32_t* position(uint32_t vertex) const {
    return group_.data() + size_t{vertex} * stride_;
  }
  bool is_same(uint32_t a, uint32_t b) const {
    return std::equal(position(a), position(a) + 3, position(b));
  }
  uint32_t slot_of(uint32_t vertex) const {
    const int32_t* const p = position(vertex);
    uint32_t hash = 0;
    for (uint32_t c = 0; c < 3; ++c) hash = (hash ^ static_cast<uint32_t>(p[c])) * 0x9e3779b9u;
    return (hash ^ hash >> 15) & static_cast<uint32_t>(heads_.size() - 1);
  }
  bool is_known(uint32_t vertex) const {
    const uint32_t v = vertex - borders_.first();
    return equal_[v] != kNone || twin_[v] != kNone;
  }
  void write(uint32_t value, uint32_t bits) { words_.emplace_back(value, bits); }

  /// How many vertices along both borders would be twins too.
  uint32_t steps_along(uint32_t vertex, uint32_t twin) const {
    uint32_t steps = 0;
    for (const bool forward : {true, false})
      follow_twins(borders_, vertex, twin, forward, [&](uint32_t later, uint32_t earlier) {
        return !is_known(later) && is_same(later, earlier) && ++steps < kMostPassed;
      });
    return steps;
  }

  uint32_t best_twin(uint32_t vertex) const {
    uint32_t best = kNone, most = 0, tried = 0;
    for (uint32_t u = heads_[slot_of(vertex)]; u != kNone && tried < kMostTried;
         u = next_with_hash_[u]) {
      if (!is_same(u, vertex)) continue;
      ++tried;
      const uint32_t steps = 1 + steps_along(vertex, u);
      if (steps > most) most = steps, best = u;
    }
    return best;
  }

  /// Codes the twin of the cluster's border vertex `i`.
  void add(uint32_t i) {
    const std::span<const uint32_t> mine = borders_.last(), others = borders_.earlier();
    const uint32_t vertex = mine[i], twin = best_twin(vertex);
    write(twin != kNone, 1);
    if (twin == kNone) return;
    const bool is_own = twin >= borders_.first();
    const std::span<const uint32_t> list = is_own ? mine.first(i) : others;
    const auto index = std::lower_bound(list.begin(), list.end(), twin) - list.begin();
    write(is_own, 1);
    write(static_cast<uint32_t>(index), bits_below(static_cast<uint32_t>(list.size())));
    twin_[vertex - borders_.first()] = twin;
    for (const bool forward : {true, false})
      follow_twins(borders_, vertex, twin, forward, [&](uint32_t later, uint32_t earlier) {
        if (is_known(later)) return false;
        const bool same = is_same(later, earlier);
        write(same, 1);
        if (same) twin_[later - borders_.first()] = earlier;
        return same;
      });
  }

  const GroupBorders& borders_;
  std::span<const uint32_t> equal_;
  std::span<const int32_t> group_;
  uint32_t stride_;
  std::vector<uint32_t>&heads_, &next_with_hash_;
  std::vector<uint32_t> twin_;
  std::vector<std::pair<uint32_t, uint32_t>> words_;  // and their bits
};

}  // namespace

Twins::Twins(size_t vertices)
    : heads_(std::bit_ceil(vertices + 1), kNone), next_with_hash_(vertices, kNone) {}

std::vector<uint32_t> Twins::encode(const GroupBorders& borders, std::span<const uint32_t> equal,
                                    std::span<const int32_t> group, uint32_t stride,
                                    BitWriter& out) {
  return ClusterTwins(borders, equal, group, stride, heads_, next_with_hash_).encode(out);
}

bool decode_twins(BitReader& reader, const GroupBorders& borders, std::span<const uint32_t> equal,
                  std::span<uint32_t> twin) {
  if (!reader.read(1)) return false;
  BitReader in = reader;  // its state stays in registers
  const uint32_t first = borders.first();
  std::array<uint8_t, kMaxLocal> is_open;  // 1: neither shared nor a twin
  for (size_t v = 0; v < twin.size(); ++v) {
    twin[v] = kNone;
    is_open[v] = equal[v] == kNone;
  }
  // Known vertices have no bit: none is taken, rather than to branch on it, too.
  const std::array links{borders.next(), borders.previous()};
  const auto follow = [&](uint32_t v, uint32_t u, bool forward) {
    const uint32_t *const ahead = links[!forward], *const back = links[forward];
    while (true) {
      v = ahead[v];
      u = back[u];
      if (v == kNone || u == kNone || v == u) return;
      const uint32_t later = std::max(v, u) - first;
      in.ensure(1);
      if (in.take(is_open[later]) == 0) return;
      is_open[later] = 0;
      twin[later] = std::min(v, u);
    }
  };
  const std::span<const uint32_t> mine = borders.last(), others = borders.earlier();
  for (uint32_t i = 0; i < mine.size(); ++i) {
    const uint32_t v = mine[i];
    in.ensure(2);
    if (in.take(is_open[v - first]) == 0) continue;
    const std::span<const uint32_t> list = in.take(1) ? mine.first(i) : others;
    const uint32_t index = in.read(bits_below(static_cast<uint32_t>(list.size())));
    if (index >= list.size())
      corrupt("a vertex has the position of the border vertex " + std::to_string(index) + " of " +
              std::to_string(list.size()));
    is_open[v - first] = 0;
    twin[v - first] = list[index];
    follow(v, list[index], true);
    follow(v, list[index], false);
  }
  reader = in;
  return true;
}

}  // namespace umbel::asset
