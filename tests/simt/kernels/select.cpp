// src/cuda/select.cu for the emulated device.
#include "cuda/select.cu"
