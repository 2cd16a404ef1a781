// What the bindings of DAGs in memory and of assets on disk share.
#pragma once

#include "bind.hpp"
#include "umbel/lod.hpp"

namespace umbel::python {

/// Throws kInvalidArgument naming the first index that is no cluster.
void check_cut(const lod::Tables& tables, std::span<const uint32_t> cut);

/// What a build says of itself.
Dict build_report(const lod::Report& report);
Dict report_dict(const lod::VerifyReport& report);
Dict geometry_dict(lod::ClusterGeometry&& geometry);

/// One cut as the arrays of a mesh; reads and welds without the GIL.
Dict cut_dict(const lod::Tables& tables, const lod::GeometryReader& geometry,
              const Flat<uint32_t>& cut);

/// (c, 11) float32: the spheres and cones of all clusters.
Array<float> normal_cone_array(const lod::Tables& tables, const lod::GeometryReader& geometry,
                               const nb::object& progress, uint32_t threads);

/// Binds what needs tables alone; `Tables` must be bound already.
void bind_select(nb::module_& module);

}  // namespace umbel::python
