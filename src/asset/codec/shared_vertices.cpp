#include "asset/codec/shared_vertices.hpp"

#include <algorithm>

namespace umbel::asset {

GroupBorders::GroupBorders(size_t vertices)
    : next_(vertices, kNone), previous_(vertices, kNone), listed_(vertices + 1) {}

BorderLinks GroupBorders::add_cluster(uint32_t vertices) {
  earlier_ = count_;
  first_ = end_;
  end_ += vertices;
  return {next_.data() + first_, previous_.data() + first_, first_};
}

void GroupBorders::list_last() {
  // Without a branch, which would be unpredictable.
  const uint32_t *const next = next_.data(), *const previous = previous_.data();
  size_t count = count_;
  for (uint32_t v = first_; v < end_; ++v) {
    listed_[count] = v;
    count += (next[v] & previous[v]) != kNone;  // all bits of both
  }
  count_ = count;
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
  for (const uint32_t v : borders_.last()) {
    const uint32_t slot = (ids_[v] * 0x9e3779b9u) & static_cast<uint32_t>(heads_.size() - 1);
    next_with_hash_[v] = heads_[slot];
    heads_[slot] = v;
  }
}

std::vector<uint32_t> SharedVertices::encode(std::span<const uint32_t> ids,
                                             std::span<const BorderEdge> edges, BitWriter& out) {
  const BorderLinks links = borders_.add_cluster(static_cast<uint32_t>(ids.size()));
  for (const BorderEdge& edge : edges) {
    links.next[edge.from] = links.first + edge.to;
    links.previous[edge.to] = links.first + edge.from;
  }
  borders_.list_last();
  ids_.insert(ids_.end(), ids.begin(), ids.end());
  source_.resize(ids_.size(), kNone);
  const std::span<const uint32_t> earlier = borders_.earlier();
  const std::span<const uint32_t> mine = borders_.last();
  const bool any =
      std::any_of(mine.begin(), mine.end(), [&](uint32_t v) { return copy_of(v, kNone) != kNone; });
  out.write(any, 1);
  for (const uint32_t v : mine.first(any ? mine.size() : 0)) {
    if (source_[v] != kNone) continue;
    const uint32_t copy = best_copy(v);
    out.write(copy != kNone, 1);
    if (copy == kNone) continue;
    const auto index = std::lower_bound(earlier.begin(), earlier.end(), copy) - earlier.begin();
    out.write(static_cast<uint32_t>(index), bits_below(static_cast<uint32_t>(earlier.size())));
    source_[v] = copy;
    follow(v, copy, true, out);
    follow(v, copy, false, out);
  }
  list_last_cluster();
  return {source_.begin() + borders_.first(), source_.end()};
}

void decode_shared(BitReader& reader, const GroupBorders& borders, std::span<uint32_t> source) {
  BitReader in = reader;  // its state stays in registers
  std::fill(source.begin(), source.end(), kNone);
  const bool any = in.read(1) != 0;
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
  for (const uint32_t v : borders.last().first(any ? borders.last().size() : 0)) {
    if (source[v - first] != kNone || !in.read(1)) continue;
    const uint32_t index = in.read(width);
    if (index >= earlier.size())
      corrupt("a cluster shares the border vertex " + std::to_string(index) + " of " +
              std::to_string(earlier.size()));
    source[v - first] = earlier[index];
    follow(v, earlier[index], true);
    follow(v, earlier[index], false);
  }
  reader = in;
}

}  // namespace umbel::asset
