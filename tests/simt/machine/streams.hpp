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
void begin_capture(StreamState& stream);
Graph end_capture(StreamState& stream);

}  // namespace umbel::simt
