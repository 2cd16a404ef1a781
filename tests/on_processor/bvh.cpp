// The processor's form of src/cuda/bvh.cu: see cuda/run.hpp.
#include "cuda/bvh.cu"
