// tests/cuda/test_trace.cu on the emulated device.
#include "cuda/test_trace.cu"
