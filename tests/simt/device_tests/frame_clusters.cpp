// tests/cuda/test_frame_clusters.cu on the emulated device.
#include "cuda/test_frame_clusters.cu"
