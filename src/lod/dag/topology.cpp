#include "lod/dag/topology.hpp"

#include <tbb/task_arena.h>

#include <algorithm>
#include <numeric>

#include "base/big_vector.hpp"
#include "base/find_root.hpp"
#include "base/parallel.hpp"

namespace umbel::lod {
namespace {

// Most vertices have about three edges to later ones, two triangles at each.
template <typename Iterator>
void sort_few(Iterator begin, Iterator end) {
  if (end - begin > 16) return std::sort(begin, end);
  for (auto i = begin; i != end; ++i) {
    const auto value = *i;
    auto j = i;
    for (; j != begin && value < *(j - 1); --j) *j = *(j - 1);
    *j = value;
  }
}

// The lowest of those that are joined, kNone for what is in no pair.
std::vector<uint32_t> components(std::span<const std::vector<PositionPair>> pairs, size_t count) {
  std::vector<uint32_t> component;
  reserve_big(component, count);
  component.resize(count, kNone);
  const auto root_of = [&](uint32_t i) {
    if (component[i] == kNone) component[i] = i;
    return find_root(component, i);
  };
  for (const std::vector<PositionPair>& some : pairs)
    for (const auto& [a, b] : some) {
      const uint32_t ra = root_of(a), rb = root_of(b);
      component[std::max(ra, rb)] = std::min(ra, rb);
    }
  for (uint32_t& c : component)
    if (c != kNone) c = component[c];
  return component;
}

}  // namespace

std::vector<uint32_t> non_manifold_components(std::span<const PositionPair> edges, size_t count) {
  // Bucket the edges by their lower end; buckets are short, so sorting them is cheap.
  BigVector<uint32_t> offsets(count + 1, 0);
  for (const auto& [a, b] : edges) ++offsets[std::min(a, b) + 1];
  std::partial_sum(offsets.begin(), offsets.end(), offsets.begin());
  BigVector<uint32_t> ends(offsets.back());  // twice the higher end, which is below 2^31
  BigVector<uint32_t> cursor(offsets.begin(), offsets.end() - 1);
  for (const auto& [a, b] : edges)
    ends[cursor[std::min(a, b)]++] = std::max(a, b) << 1 | uint32_t{a < b};

  constexpr size_t kChunk = 1 << 16;
  std::vector<std::vector<PositionPair>> found((count + kChunk - 1) / kChunk);
  const auto find = [&](size_t first, size_t last) {
    for (size_t a = first; a < last; ++a) {
      const auto begin = ends.begin() + offsets[a], end = ends.begin() + offsets[a + 1];
      sort_few(begin, end);
      for (auto i = begin; i != end;) {
        const uint32_t b = *i >> 1;
        const auto run = std::find_if(i, end, [&](uint32_t e) { return e >> 1 != b; });
        if (run - i != 2 || *i == *(i + 1))
          found[first / kChunk].push_back({static_cast<uint32_t>(a), b});
        i = run;
      }
    }
  };
  // While it waits, a thread that simplifies a group may not begin another with the same memory.
  tbb::this_task_arena::isolate([&] { parallel_chunks(count, kChunk, find); });
  return components(found, count);
}

std::vector<uint32_t> non_manifold_components(std::span<const Triangle> triangles,
                                              std::span<const uint32_t> position_ids) {
  std::vector<PositionPair> edges;
  for (const Triangle& t : triangles) {
    const uint32_t a = position_ids[t[0]], b = position_ids[t[1]], c = position_ids[t[2]];
    if (a == b || b == c || c == a) continue;
    edges.insert(edges.end(), {{a, b}, {b, c}, {c, a}});
  }
  return non_manifold_components(edges, position_ids.size());
}

SubMeshTopology::Entry& SubMeshTopology::entry(uint32_t a, uint32_t b) {
  const PositionPair edge{std::min(a, b), std::max(a, b)};
  const uint32_t next = static_cast<uint32_t>(entries_.size());
  const uint32_t found = index_.find_or_insert(
      IntegerHash()(edge_key(edge)), next, [&](uint32_t i) { return entries_[i].edge == edge; });
  if (found == next) entries_.push_back({edge, 0, 0, 0});
  return entries_[found];
}

void SubMeshTopology::set_sub_mesh(std::span<const Triangle> triangles,
                                   std::span<const uint8_t> locked,
                                   std::span<const uint32_t> component) {
  locked_ = locked;
  component_ = component;
  // Of the sub-mesh's own edges only those between two locked vertices matter: their number is
  // known to the neighbours.
  own_locked_edges_.clear();
  for (const Triangle& t : triangles)
    for (int i = 0; i < 3; ++i)
      if (locked[t[i]] && locked[t[(i + 1) % 3]])
        own_locked_edges_.push_back({t[i], t[(i + 1) % 3]});
}

// Finds violations and all new edges between locked vertices.
void SubMeshTopology::count_edges(std::span<const Triangle> result, bool by_direction) {
  entries_.clear();
  index_.reset(3 * result.size() + own_locked_edges_.size());
  violations_.clear();
  locked_edges_.clear();
  for (const Triangle& t : result)
    for (int i = 0; i < 3; ++i) {
      const uint32_t a = t[i], b = t[(i + 1) % 3];
      Entry& e = entry(a, b);
      ++e.after;
      e.net += a < b ? 1 : -1;
    }
  for (const auto& [a, b] : own_locked_edges_) {
    Entry& e = entry(a, b);
    ++e.before;
    e.net -= a < b ? 1 : -1;
  }
  for (const Entry& e : entries_) {
    const auto [a, b] = e.edge;
    // What the caller holds stays open where it was, and nowhere else.
    const bool held = locked_[a] == kHeld && locked_[b] == kHeld;
    if (!held && component_[a] != kNone && component_[a] == component_[b]) continue;
    const bool fixed = locked_[a] && locked_[b];
    const bool parity_changed = fixed ? ((e.before ^ e.after) & 1) != 0 : (e.after & 1) != 0;
    const bool is_turned = by_direction && e.net != 0;
    const bool is_new = !is_turned && fixed && e.before == 0 && e.after == 2;
    if (is_new)
      locked_edges_.push_back({a, b});
    else if (is_turned || parity_changed || e.after > 2 || (fixed && e.after > e.before))
      violations_.push_back({a, b});
  }
}

}  // namespace umbel::lod
