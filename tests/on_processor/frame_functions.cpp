#include "run.hpp"

// What is above comes first.
#include "cuda/frame_functions.hpp"
