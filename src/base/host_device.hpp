// Marks of code that runs on the processor and on CUDA devices.
#pragma once

#if defined(__CUDACC__)
/// Functions and members.
#define UMBEL_HOST_DEVICE __host__ __device__
/// Function objects written in place, for an executor: on a device only, where they may have
/// captures of their own.
#define UMBEL_DEVICE_LAMBDA __device__
#else
#define UMBEL_HOST_DEVICE
#define UMBEL_DEVICE_LAMBDA
#endif
