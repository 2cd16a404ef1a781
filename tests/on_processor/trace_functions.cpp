#include "run.hpp"

// What is above comes first.
#include "cuda/trace_functions.hpp"
