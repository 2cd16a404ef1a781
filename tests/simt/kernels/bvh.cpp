// src/cuda/bvh.cu for the emulated device.
#include "cuda/bvh.cu"
