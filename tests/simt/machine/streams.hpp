// Streams of the emulated device: work waits until somebody waits for it, or is captured.
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <vector>

namespace umbel::simt {

using Work = std::function<void()>;

struct StreamState {
  bool captures = false;
  std::shared_ptr<std::vector<Work>> captured;
};

struct Graph {
  std::vector<Work> work;
};

/// Puts work behind all other work, or into the graph that the stream is captured in. A null stream
/// is the default stream.
void enqueue(StreamState* stream, Work work);
/// Does what is queued.
void finish();
/// Fills what an arena takes or gives back, in the order of the work around it.
void poison(void* memory, size_t bytes);

// There are two devices, which are told apart and work alike. Memory belongs to the one that was
// current when it was allocated.
int current_device();
void set_device(int device);
void allocated(const void* memory, size_t bytes);
void freed(const void* memory);
/// -1 for memory of the host.
int device_of(const void* memory);
/// A kernel is started on the current device.
void launched();
/// How many kernels were started on a device.
size_t launches(int device);

void begin_capture(StreamState& stream);
Graph end_capture(StreamState& stream);

}  // namespace umbel::simt
