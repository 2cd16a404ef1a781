#include "run.hpp"

// What is above comes first.
#include "cuda/select_functions.hpp"
