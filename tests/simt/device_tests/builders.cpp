// tests/cuda/test_builders.cu on the emulated device.
#include "cuda/test_builders.cu"
