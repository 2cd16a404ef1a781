// A machine that runs CUDA's threads as fibers on one thread of the processor, one at a time, in an
// order that a seed decides. Kernels see it through the headers in shim/.
//
// This side of it is compiled without ThreadSanitizer, the kernels with it: what they do to memory
// is ordered for it by exactly that which orders it on a device (machine.cpp says by what).
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>

namespace umbel::simt {

inline constexpr uint32_t kWarpLanes = 32;

struct Index3 {
  uint32_t x = 0, y = 0, z = 0;
};

/// Of the thread that runs.
extern Index3 thread_index, block_index, block_size, grid_size;

/// From here on all choices are those of this seed.
void set_seed(uint64_t seed);
/// A number in [0, end) by the seed.
uint32_t random_below(uint32_t end);

/// What a device is said to have, by the seed.
int multiprocessors();
int blocks_per_multiprocessor();
/// Most blocks of a cooperative launch, where the device is shared: fewer than it is said to have.
uint32_t blocks_together();
void set_blocks_together(uint32_t blocks);

/// Runs `thread` as each thread of a grid, some blocks at a time, in any order. In a cooperative
/// launch all blocks at a time.
void run_grid(uint32_t blocks, uint32_t threads, bool is_cooperative,
              const std::function<void()>& thread);

/// Lets other threads run; before every atomic operation.
void yield();

// Each of these names by its caller's address the place in a kernel that it was called from.

enum class WarpOp : uint32_t { kSync, kBallot, kShuffle, kShuffleXor, kMatch };

void meet_block();
uint32_t count_in_block(bool flag);
void meet_grid();
/// What the lanes of `mask` agree on: the ballot, or the value of the lane `from`, or of the one
/// whose number differs by the bits of `from`; or the lanes with the same value.
uint64_t meet_warp(WarpOp op, uint32_t mask, uint64_t value, uint32_t from);
/// The lanes that happen to be at this place together.
uint32_t gather_lanes();
/// A fence: what was released where the thread's last atomic operation was is seen from here on.
void acquire_last();
/// Says that an atomic operation is about to happen.
void before_atomic(const void* address);
/// The same of one that releases what its thread wrote; false where that is to be left out.
bool releases(const void* counter);

/// Memory of a block for an array, filled with rubbish. `array` tells arrays of a kernel apart.
void* shared_memory(const void* array, size_t bytes);

/// Ends the program: a kernel did what CUDA does not allow.
[[noreturn]] void fail(const char* what);

}  // namespace umbel::simt
