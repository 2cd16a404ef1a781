// src/cuda/memory.cu for the emulated device.
#include "cuda/memory.cu"
