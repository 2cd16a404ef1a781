// All of Umbel's C++ interface for CUDA devices. cuda_types.hpp says what holds of all functions.
#pragma once

#include "umbel/cuda_bvh.hpp"
#include "umbel/cuda_cluster_bvh.hpp"
#include "umbel/cuda_clusters.hpp"
#include "umbel/cuda_memory.hpp"
#include "umbel/cuda_select.hpp"
#include "umbel/cuda_trace.hpp"
#include "umbel/cuda_types.hpp"
