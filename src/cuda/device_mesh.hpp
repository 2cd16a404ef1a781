// The triangles of cuda_types.hpp as the algorithms take them.
#pragma once

#include <string>

#include "cluster/frame/frame_mesh.hpp"
#include "umbel/cuda_types.hpp"

namespace umbel::cuda {

static_assert(sizeof(Triangle) == 3 * sizeof(uint32_t));

inline cluster::Positions positions_of(const DeviceMesh& mesh) {
  if (mesh.position_stride < sizeof(Vec3) || mesh.position_stride % sizeof(float) != 0)
    throw Error(ErrorCode::kInvalidArgument,
                "position_stride must be a multiple of 4 and at least 12, not " +
                    std::to_string(mesh.position_stride));
  return {static_cast<const char*>(mesh.positions), mesh.position_stride};
}

}  // namespace umbel::cuda
