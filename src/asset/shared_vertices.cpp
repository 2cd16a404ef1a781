#include "asset/shared_vertices.hpp"

#include <algorithm>

namespace umbel::asset {

GroupBorders::GroupBorders(size_t vertices) {
  next_.reserve(vertices);
  previous_.reserve(vertices);
  listed_.reserve(vertices);
}

void GroupBorders::add_cluster(uint32_t vertices, std::span<const BorderEdge> edges) {
  earlier_ = listed_.size();
  first_ = end();
  next_.resize(size_t{first_} + vertices, kNone);
  previous_.resize(size_t{first_} + vertices, kNone);
  for (const BorderEdge& edge : edges) {
    next_[first_ + edge.from] = first_ + edge.to;
    previous_[first_ + edge.to] = first_ + edge.from;
  }
  for (uint32_t v = first_; v < end(); ++v)
    if (is_border(v)) listed_.push_back(v);
}

SharedVertices::SharedVertices(size_t vertices)
    : borders_(vertices),
      heads_(std::bit_ceil(vertices + 1), kNone),
      next_with_hash_(vertices, kNone) {
  ids_.reserve(vertices);
  source_.reserve(vertices);
}

/// The earlier border vertex with this one's id that was listed before `after`, or the last of
/// all for kNone.
uint32_t SharedVertices::copy_of(uint32_t vertex, uint32_t after) const {
  const uint32_t slot = (ids_[vertex] * 0x9e3779b9u) & static_cast<uint32_t>(heads_.size() - 1);
  uint32_t copy = after == kNone ? heads_[slot] : next_with_hash_[after];
  while (copy != kNone && ids_[copy] != ids_[vertex]) copy = next_with_hash_[copy];
  return copy;
}

/// How many vertices from the next one on are the same along both borders.
uint32_t SharedVertices::steps_along(uint32_t vertex, uint32_t earlier, bool forward) const {
  uint32_t steps = 0;
  for (; steps < kMaxLocal; ++steps) {
    vertex = forward ? borders_.next(vertex) : borders_.previous(vertex);
    earlier = forward ? borders_.previous(earlier) : borders_.next(earlier);
    if (vertex == kNone || earlier == kNone || source_[vertex] != kNone ||
        ids_[vertex] != ids_[earlier])
      break;
  }
  return steps;
}

uint32_t SharedVertices::best_copy(uint32_t vertex) const {
  uint32_t best = copy_of(vertex, kNone);
  if (best == kNone) return kNone;
  uint32_t most = 0;
  for (uint32_t copy = best; copy != kNone; copy = copy_of(vertex, copy)) {
    const uint32_t steps = steps_along(vertex, copy, true) + steps_along(vertex, copy, false);
    if (steps > most) most = steps, best = copy;
  }
  return best;
}

void SharedVertices::follow(uint32_t vertex, uint32_t earlier, bool forward, BitWriter& out) {
  while (true) {
    vertex = forward ? borders_.next(vertex) : borders_.previous(vertex);
    earlier = forward ? borders_.previous(earlier) : borders_.next(earlier);
    if (vertex == kNone || earlier == kNone || source_[vertex] != kNone) return;
    const bool same = ids_[vertex] == ids_[earlier];
    out.write(same, 1);
    if (!same) return;
    source_[vertex] = earlier;
  }
}

void SharedVertices::list_last_cluster() {
  for (uint32_t v = borders_.first(); v < borders_.end(); ++v) {
    if (!borders_.is_border(v)) continue;
    const uint32_t slot = (ids_[v] * 0x9e3779b9u) & static_cast<uint32_t>(heads_.size() - 1);
    next_with_hash_[v] = heads_[slot];
    heads_[slot] = v;
  }
}

std::vector<uint32_t> SharedVertices::encode(std::span<const uint32_t> ids,
                                             std::span<const BorderEdge> edges, BitWriter& out) {
  borders_.add_cluster(static_cast<uint32_t>(ids.size()), edges);
  ids_.insert(ids_.end(), ids.begin(), ids.end());
  source_.resize(ids_.size(), kNone);
  const std::span<const uint32_t> earlier = borders_.earlier();
  const auto shares = [&](uint32_t v) {
    return borders_.is_border(v) && copy_of(v, kNone) != kNone;
  };
  bool any = false;
  for (uint32_t v = borders_.first(); v < borders_.end() && !any; ++v) any = shares(v);
  out.write(any, 1);
  for (uint32_t v = borders_.first(); any && v < borders_.end(); ++v) {
    if (!borders_.is_border(v) || source_[v] != kNone) continue;
    const uint32_t copy = best_copy(v);
    out.write(copy != kNone, 1);
    if (copy == kNone) continue;
    const auto place = std::lower_bound(earlier.begin(), earlier.end(), copy) - earlier.begin();
    out.write(static_cast<uint32_t>(place), bits_below(static_cast<uint32_t>(earlier.size())));
    source_[v] = copy;
    follow(v, copy, true, out);
    follow(v, copy, false, out);
  }
  list_last_cluster();
  return {source_.begin() + borders_.first(), source_.end()};
}

void decode_shared(BitReader& in, const GroupBorders& borders, std::span<uint32_t> source) {
  std::fill(source.begin(), source.end(), kNone);
  if (!in.read(1)) return;
  const uint32_t first = borders.first();
  const std::span<const uint32_t> earlier = borders.earlier();
  const uint32_t width = bits_below(static_cast<uint32_t>(earlier.size()));
  const auto follow = [&](uint32_t vertex, uint32_t copy, bool forward) {
    while (true) {
      vertex = forward ? borders.next(vertex) : borders.previous(vertex);
      copy = forward ? borders.previous(copy) : borders.next(copy);
      if (vertex == kNone || copy == kNone || source[vertex - first] != kNone || !in.read(1))
        return;
      source[vertex - first] = copy;
    }
  };
  for (uint32_t v = first; v < borders.end(); ++v) {
    if (!borders.is_border(v) || source[v - first] != kNone || !in.read(1)) continue;
    const uint32_t place = in.read(width);
    if (place >= earlier.size())
      corrupt("a cluster shares the border vertex " + std::to_string(place) + " of " +
              std::to_string(earlier.size()));
    source[v - first] = earlier[place];
    follow(v, earlier[place], true);
    follow(v, earlier[place], false);
  }
}

}  // namespace umbel::asset
