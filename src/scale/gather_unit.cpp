#include "scale/gather_unit.hpp"

#include <algorithm>
#include <numeric>
#include <unordered_map>
#include <utility>

#include "base/math.hpp"

namespace umbel::scale {
namespace {

// Sets of positions that non-manifold edges join.
class Labels {
 public:
  explicit Labels(size_t positions) : node_at_(positions, kNone) {}

  void join(uint32_t position, uint64_t label) {
    const auto [at, is_new] = node_of_.try_emplace(label, static_cast<uint32_t>(parent_.size()));
    if (is_new) parent_.push_back(at->second);
    add(position, at->second);
  }
  void join_positions(uint32_t a, uint32_t b) {
    const uint32_t node = static_cast<uint32_t>(parent_.size());
    parent_.push_back(node);
    add(a, node);
    add(b, node);
  }

  // Of each position, the lowest that it is joined to; kNone where it touches no such edge.
  std::vector<uint32_t> components() {
    std::vector<uint32_t> lowest(parent_.size(), kNone), result(node_at_.size(), kNone);
    for (uint32_t p = 0; p < node_at_.size(); ++p) {
      if (node_at_[p] == kNone) continue;
      uint32_t& first = lowest[root(node_at_[p])];
      if (first == kNone) first = p;
      result[p] = first;
    }
    return result;
  }

 private:
  uint32_t root(uint32_t node) {
    while (parent_[node] != node) node = parent_[node] = parent_[parent_[node]];
    return node;
  }
  void add(uint32_t position, uint32_t node) {
    if (node_at_[position] == kNone) node_at_[position] = node;
    const uint32_t a = root(node_at_[position]), b = root(node);
    parent_[std::max(a, b)] = std::min(a, b);
  }

  std::vector<uint32_t> node_at_, parent_;
  std::unordered_map<uint64_t, uint32_t> node_of_;
};

class Gatherer {
 public:
  Gatherer(std::vector<Slice> slices, const TierConfig& tier) : slices_(std::move(slices)) {
    gather_vertices();
    lod::find_shared_positions(out_.unit.source);
    out_.unit.source.scale = lod::simplification_scale(tier.box);
    out_.unit.level = tier.level;
    out_.unit.is_whole = false;
    gather_clusters();
    for (uint32_t v = 0; v < ids().size(); ++v) {
      const uint32_t number = known_.insert(out_.unit.source.mesh.positions[v]).first;
      if (number == position_of_.size()) position_of_.push_back(ids()[v]);
    }
  }

  GatheredUnit run(const std::vector<PositionEdge>& non_manifold, const Partition& partition,
                   uint32_t unit) {
    freeze(partition, unit);
    join_labels(non_manifold);
    gather_edges();
    return std::move(out_);
  }

 private:
  const std::vector<uint32_t>& ids() const { return out_.unit.source.position_ids; }

  uint32_t find(const Vec3& position) const {
    const uint32_t number = known_.find(position);
    return number == kNone ? kNone : position_of_[number];
  }

  void gather_vertices() {
    VertexTable table;
    bool has_materials = false;
    size_t vertices = 0;
    for (const Slice& slice : slices_) {
      has_materials |= !slice.exits.materials.empty();
      vertices += slice.exits.flags.size();
    }
    table.reserve(vertices);
    for (const Slice& slice : slices_) {
      const Exits& exits = slice.exits;
      std::vector<uint32_t>& numbers = numbers_.emplace_back();
      for (uint32_t v = 0; v < exits.flags.size(); ++v)
        numbers.push_back(
            table.insert(exits.vertices, v, exits.materials.empty() ? 0 : exits.materials[v]));
    }
    lod::Source& source = out_.unit.source;
    source.mesh = table.take_mesh();
    if (has_materials) source.vertex_materials = table.take_materials();
  }

  void gather_clusters() {
    std::vector<lod::ClusterRef> refs;
    for (size_t s = 0; s < slices_.size(); ++s) {
      Exits& exits = slices_[s].exits;
      for (uint32_t& v : exits.clusters.vertices) v = numbers_[s][v];
      for (uint32_t& g : exits.clusters.generating_group)
        if (g != kNone) g = number_generator(exits.generators[g]);
      for (uint32_t c = 0; c < exits.clusters.size(); ++c) refs.push_back({&exits.clusters, c});
      out_.unit.spheres.insert(out_.unit.spheres.end(), exits.spheres.begin(), exits.spheres.end());
    }
    out_.unit.pending = lod::gather_clusters(refs);
  }

  uint32_t number_generator(const Generator& generator) {
    const auto [at, is_new] =
        generator_of_.try_emplace(generator.id, static_cast<uint32_t>(out_.generators.size()));
    if (is_new) {
      out_.generators.push_back(generator);
      out_.unit.generators.push_back({generator.sphere, generator.error});
    }
    return at->second;
  }

  // What may be shared, and is at home elsewhere or known to be in other units.
  void freeze(const Partition& partition, uint32_t unit) {
    std::vector<uint8_t> flags(ids().size(), 0), is_mailed(ids().size(), 0);
    for (size_t s = 0; s < slices_.size(); ++s)
      for (size_t v = 0; v < numbers_[s].size(); ++v)
        flags[ids()[numbers_[s][v]]] |= slices_[s].exits.flags[v];
    for (const Slice& slice : slices_)
      for (const Vec3& p : slice.mail)
        if (const uint32_t id = find(p); id != kNone) is_mailed[id] = 1;
    std::vector<uint32_t> was_frozen;
    lod::Unit& out = out_.unit;
    out.locked.assign(ids().size(), 0);
    for (uint32_t p = 0; p < ids().size(); ++p) {
      if (ids()[p] != p) continue;
      out.locked[p] = (flags[p] & kWasLocked) != 0;
      if (flags[p] & kWasFrozen) was_frozen.push_back(p);
      if ((flags[p] & kSeveralMaterials) && !out.source.several_materials.empty())
        out.source.several_materials[p] = 1;
      if (!(flags[p] & kMayBeShared)) continue;
      if (is_mailed[p] || partition.home(out.source.mesh.positions[p]) != unit)
        out.frozen.push_back(p);
    }
    out.locked_edges.freeze(was_frozen);
    out.locked_edges.freeze(out.frozen);
  }

  void join_labels(const std::vector<PositionEdge>& non_manifold) {
    Labels labels(ids().size());
    for (size_t s = 0; s < slices_.size(); ++s)
      for (size_t v = 0; v < numbers_[s].size(); ++v)
        if (const uint32_t label = slices_[s].exits.labels[v]; label != kNone)
          labels.join(ids()[numbers_[s][v]], uint64_t{s} << 32 | label);
    for (const PositionEdge& edge : non_manifold) {
      const uint32_t a = find(edge.from), b = find(edge.to);
      if (a != kNone || b != kNone) labels.join_positions(a == kNone ? b : a, b == kNone ? a : b);
    }
    out_.unit.source.non_manifold_components = labels.components();
  }

  void gather_edges() {
    for (const Slice& slice : slices_)
      for (const PositionEdge& edge : slice.exits.locked_edges) {
        const uint32_t a = find(edge.from), b = find(edge.to);
        if (a != kNone && b != kNone) {
          const lod::PositionPair pair{a, b};
          out_.unit.locked_edges.insert({&pair, 1});
        } else if (a != kNone || b != kNone) {
          out_.half_known.push_back({a == kNone ? b : a, edge});
        }
      }
  }

  std::vector<Slice> slices_;
  std::vector<std::vector<uint32_t>> numbers_;  // of the vertices of slices
  std::unordered_map<uint64_t, uint32_t> generator_of_;
  Interner<Vec3, ValueHash> known_;
  std::vector<uint32_t> position_of_;  // ids, by number in known_
  GatheredUnit out_;
};

}  // namespace

GatheredUnit gather_unit(std::vector<Slice> slices, const std::vector<PositionEdge>& non_manifold,
                         const Partition& partition, uint32_t unit, const TierConfig& tier) {
  return Gatherer(std::move(slices), tier).run(non_manifold, partition, unit);
}

}  // namespace umbel::scale
