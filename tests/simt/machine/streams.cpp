#include "streams.hpp"

#include <cstring>
#include <deque>
#include <map>
#include <utility>

namespace umbel::simt {
namespace {

std::deque<Work> queued;
StreamState* capturing = nullptr;

struct Block {
  size_t bytes;
  int device;
};
std::map<const char*, Block> blocks;
int device_now = 0;
size_t started[2] = {};

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

int current_device() { return device_now; }

void set_device(int device) { device_now = device; }

void allocated(const void* memory, size_t bytes) {
  blocks[static_cast<const char*>(memory)] = {bytes, device_now};
}

void freed(const void* memory) { blocks.erase(static_cast<const char*>(memory)); }

int device_of(const void* memory) {
  const auto* byte = static_cast<const char*>(memory);
  auto after = blocks.upper_bound(byte);
  if (after == blocks.begin()) return -1;
  const auto& [begin, block] = *--after;
  return byte < begin + block.bytes ? block.device : -1;
}

void launched() { ++started[device_now]; }

size_t launches(int device) { return started[device]; }

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
