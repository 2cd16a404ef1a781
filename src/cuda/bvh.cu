// Hierarchies of triangles, on a device.
#include "cuda/run.cuh"

// What is above comes first.
#include "cuda/bvh_functions.hpp"
