#include "scale/unit_task.hpp"

#include <utility>

#include "base/interner.hpp"
#include "base/math.hpp"
#include "base/progress.hpp"
#include "lod/build/unit_builder.hpp"
#include "lod/dag/source.hpp"
#include "mesh/vertex_bits.hpp"
#include "scale/gather_unit.hpp"
#include "scale/parts.hpp"

namespace umbel::scale {
namespace {

// What the next tier gets of a unit once it is built. Nothing of use is left in the unit.
class ExitWriter {
 public:
  ExitWriter(lod::Unit& unit, std::vector<Generator> generators)
      : unit_(unit), generators_(std::move(generators)) {}

  Exits run(const std::vector<HalfKnownEdge>& half_known,
            const std::vector<lod::PositionPair>& undecided) {
    list_vertices();
    std::vector<PositionEdge> locked_edges = edges_that_go_on(half_known);
    std::vector<PositionEdge> undecided_edges;
    for (const auto& [a, b] : undecided) undecided_edges.push_back({position(a), position(b)});
    Exits all;
    all.vertices = std::move(unit_.source.mesh);
    all.materials = std::move(unit_.source.vertex_materials);
    all.clusters = std::move(unit_.pending);
    all.spheres = std::move(unit_.spheres);
    all.generators = std::move(generators_);
    const auto& ids = unit_.source.position_ids;
    for (const uint32_t p : ids) {
      all.labels.push_back(unit_.source.non_manifold_components[p]);
      all.flags.push_back(flags_[p]);
    }
    Exits exits = with_used_only(std::move(all));
    exits.locked_edges = std::move(locked_edges);
    exits.undecided = std::move(undecided_edges);
    exits.new_positions = std::move(unit_.new_positions);
    return exits;
  }

 private:
  Vec3 position(uint32_t id) const { return unit_.source.mesh.positions[id]; }

  void list_vertices() {
    const lod::Source& source = unit_.source;
    const size_t count = source.position_ids.size();
    flags_.assign(count, 0);
    is_left_.assign(count, 0);
    std::vector<uint32_t> last(count, kNone);
    for (uint32_t c = 0; c < unit_.pending.size(); ++c)
      for (const uint32_t v : unit_.pending.cluster_vertices(c)) {
        const uint32_t p = source.position_ids[v];
        if (last[p] != kNone && last[p] != c) flags_[p] |= kMayBeShared;
        last[p] = c;
        is_left_[p] = 1;
      }
    for (const uint32_t p : unit_.frozen) flags_[p] |= kMayBeShared;
    for (uint32_t p = 0; p < count; ++p) {
      if (unit_.locked[p]) flags_[p] |= kWasLocked;
      if (unit_.locked_edges.was_frozen(p)) flags_[p] |= kWasFrozen;
      if (!source.several_materials.empty() && source.several_materials[p])
        flags_[p] |= kSeveralMaterials;
    }
  }

  // An edge can only come back where both ends are still somewhere. Between two positions that
  // were frozen there is no new edge anyway.
  std::vector<PositionEdge> edges_that_go_on(const std::vector<HalfKnownEdge>& half_known) const {
    const lod::LockedEdgeSet& edges = unit_.locked_edges;
    const auto may_live = [&](uint32_t p) { return is_left_[p] || edges.was_frozen(p); };
    std::vector<PositionEdge> result;
    edges.for_each([&](const lod::PositionPair& edge) {
      const auto [a, b] = edge;
      if (!may_live(a) || !may_live(b) || !(is_left_[a] || is_left_[b])) return;
      if (edges.was_frozen(a) && edges.was_frozen(b)) return;
      result.push_back({position(a), position(b)});
    });
    for (const HalfKnownEdge& half : half_known)
      if (is_left_[half.position]) result.push_back(half.edge);
    return result;
  }

  lod::Unit& unit_;
  std::vector<Generator> generators_;
  std::vector<uint8_t> flags_, is_left_;  // by position id
};

// Some rounds, or all that are left. `generators`: of the clusters that the unit begins with.
BuiltUnit run(lod::Unit& unit, std::vector<Generator> generators,
              const std::vector<HalfKnownEdge>& half_known, const TierConfig& tier,
              const UnitOutput& output, bool is_first) {
  BuiltUnit built;
  unit.unused = output.unused;
  PartsWriter writer(output.parts, unit, generators, output.serial);
  const BuildOptions quiet;
  Progress progress(quiet);
  const lod::Decimator none;
  std::vector<lod::PositionPair> undecided;
  const size_t known = generators.size();
  {
    lod::UnitBuilder builder(unit, tier.config, none, writer, built.report, progress);
    if (is_first) builder.make_finest_level(&undecided);
    builder.run(tier.is_last ? lod::UnitBuilder::kAllRounds : tier.rounds);
    if (tier.is_last) builder.write_roots();
  }
  writer.commit();
  for (size_t g = known; g < unit.generators.size(); ++g)
    generators.push_back({group_id(output.serial, static_cast<uint32_t>(g - known)),
                          unit.generators[g].sphere, unit.generators[g].error});
  built.next_level = unit.level;
  if (!tier.is_last)
    built.exits = ExitWriter(unit, std::move(generators)).run(half_known, undecided);
  return built;
}

}  // namespace

BuiltUnit build_unit(UnitInput input, const TierConfig& tier, const UnitOutput& output) {
  lod::Unit unit;
  unit.source = lod::make_source(input.mesh.view(), BuildOptions{});
  unit.source.scale = lod::simplification_scale(tier.box);
  unit.level = tier.level;
  unit.is_whole = tier.is_whole;
  Interner<Vec3, ValueHash> frozen;
  for (uint32_t v = 0; v < input.frozen.size(); ++v)
    if (input.frozen[v]) frozen.insert(without_negative_zero(input.mesh.positions[v]));
  for (uint32_t p = 0; p < unit.source.position_ids.size(); ++p)
    if (unit.source.position_ids[p] == p && frozen.contains(unit.source.mesh.positions[p]))
      unit.frozen.push_back(p);
  input = {};
  return run(unit, {}, {}, tier, output, true);
}

BuiltUnit build_unit(std::vector<Slice> slices, const std::vector<PositionEdge>& non_manifold,
                     const Partition& partition, uint32_t unit, const TierConfig& tier,
                     const UnitOutput& output) {
  GatheredUnit gathered = gather_unit(std::move(slices), non_manifold, partition, unit, tier);
  return run(gathered.unit, std::move(gathered.generators), gathered.half_known, tier, output,
             false);
}

}  // namespace umbel::scale
