// The algorithms for meshes that change every frame, on a device.
#include "cuda/run.cuh"

// What is above comes first.
#include "cuda/frame_functions.hpp"
