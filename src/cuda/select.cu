// Selection on a device.
#include "cuda/run.cuh"

// What is above comes first.
#include "cuda/select_functions.hpp"
