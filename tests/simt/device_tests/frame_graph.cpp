// tests/cuda/test_frame_graph.cu on the emulated device.
#include "cuda/test_frame_graph.cu"
