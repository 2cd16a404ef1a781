// tests/cuda/test_device_guard.cu on the emulated device.
#include "cuda/test_device_guard.cu"
