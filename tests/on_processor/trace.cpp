// The processor's form of src/cuda/trace.cu: see cuda/run.hpp.
#include "cuda/trace.cu"
