// src/cuda/clusters.cu for the emulated device.
#include "cuda/clusters.cu"
