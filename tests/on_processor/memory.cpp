// The processor's form of src/cuda/memory.cu: see cuda/run.hpp.
#include "cuda/memory.cu"
