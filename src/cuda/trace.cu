// Rays, closest points and overlaps on a device.
#include "cuda/run.cuh"

// What is above comes first.
#include "cuda/trace_functions.hpp"
