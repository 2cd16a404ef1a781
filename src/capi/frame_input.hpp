// umbel_frame_config as the C++ interface takes it, on the processor and on devices.
#pragma once

#include "umbel/frame_clusters.hpp"
#include "umbel/umbel_frame_clusters.h"

namespace umbel::capi {

/// Throws where its init function has not filled it.
FrameClusterConfig frame_config(const umbel_frame_config* config);

}  // namespace umbel::capi
