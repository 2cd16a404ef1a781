// The processor's form of src/cuda/clusters.cu: see cuda/run.hpp.
#include "cuda/clusters.cu"
