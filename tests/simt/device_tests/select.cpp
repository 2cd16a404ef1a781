// tests/cuda/test_select.cu on the emulated device.
#include "cuda/test_select.cu"
