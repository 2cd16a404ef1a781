#include "streams.hpp"

#include <cstring>
#include <deque>
#include <utility>

namespace umbel::simt {
namespace {

std::deque<Work> queued;
StreamState* capturing = nullptr;

}  // namespace

void enqueue(StreamState* stream, Work work) {
  if (stream && stream->captures)
    stream->captured->push_back(std::move(work));
  else
    queued.push_back(std::move(work));
}

void finish() {
  while (!queued.empty()) {
    const Work work = std::move(queued.front());
    queued.pop_front();
    work();
  }
}

void poison(void* memory, size_t bytes) {
  if (bytes > 0) enqueue(capturing, [=] { memset(memory, 0xb7, bytes); });
}

void begin_capture(StreamState& stream) {
  stream.captures = true;
  stream.captured = std::make_shared<std::vector<Work>>();
  capturing = &stream;
}

Graph end_capture(StreamState& stream) {
  stream.captures = false;
  capturing = nullptr;
  return {std::move(*stream.captured)};
}

}  // namespace umbel::simt
