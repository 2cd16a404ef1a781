// The processor's form of src/cuda/select.cu: see cuda/run.hpp.
#include "cuda/select.cu"
