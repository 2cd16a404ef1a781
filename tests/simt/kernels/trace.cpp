// src/cuda/trace.cu for the emulated device.
#include "cuda/trace.cu"
