// tests/cuda/test_cuda_exec.cu on the emulated device.
#include "cuda/test_cuda_exec.cu"
