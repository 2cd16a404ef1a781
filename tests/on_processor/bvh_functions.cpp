#include "run.hpp"

// What is above comes first.
#include "cuda/bvh_functions.hpp"
