// What kernels do to memory, counted on the processor. GCC's -fsanitize=thread calls a function at
// every load, store and atomic operation; those of calls.cpp take the place of ThreadSanitizer's
// and count them for the kernel that runs. One thread of the processor runs all kernels.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace bench {

/// Devices move memory in sectors of 32 bytes.
inline constexpr uint64_t kSector = 32;

/// What a kernel does to global memory.
struct KernelCounts {
  std::string stage;
  uint64_t launches = 0;
  uint64_t words_read = 0, words_written = 0;  ///< of 4 bytes, as the code asks for them
  uint64_t atomics = 0;
  uint64_t longest = 0;  ///< words and atomic operations of the thread that has the most
  uint64_t bytes = 0;    ///< sectors that it reads before it writes them, and that it writes

  void add(const KernelCounts& o) {
    launches += o.launches;
    words_read += o.words_read;
    words_written += o.words_written;
    atomics += o.atomics;
    longest = longest > o.longest ? longest : o.longest;
    bytes += o.bytes;
  }
};

/// Begins a kernel, or what stands for several.
void begin_kernel(uint64_t launches = 1);
/// Begins a thread of it.
void begin_thread();
/// Counts arrays that are read or written from one end to the other.
void count_arrays(uint64_t bytes_read, uint64_t bytes_written);
/// Memory that does not count from here on: a team's.
void pass_over(const void* begin, uint64_t bytes);
KernelCounts end_kernel();

}  // namespace bench
