// Scratch memory that the caller gives: handed out from the front, given back from the end.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <string>
#include <type_traits>
#include <utility>

#include "umbel/types.hpp"

// The emulator of tests/simt fills memory that is taken or given back.
#if !defined(UMBEL_POISON)
#define UMBEL_POISON(memory, bytes) ((void)0)
#endif

namespace umbel::cuda {

/// Without memory an arena only counts: the same calls in the same order, without any work, tell
/// how much the work will need.
class Arena {
 public:
  static constexpr size_t kAlignment = 256;  ///< what cudaMalloc gives as well

  Arena() = default;
  Arena(void* memory, size_t bytes) : memory_(static_cast<char*>(memory)), bytes_(bytes) {
    if (reinterpret_cast<uintptr_t>(memory) % kAlignment != 0)
      throw Error(ErrorCode::kInvalidArgument, "scratch memory must be aligned to 256 bytes");
    if (!memory && bytes > 0)
      throw Error(ErrorCode::kInvalidArgument, "scratch memory must not be null");
    counts_ = false;
  }

  bool counts() const { return counts_; }
  /// The most bytes that were taken at a time.
  size_t most() const { return most_; }

  /// Bytes at kAlignment; null while it counts.
  void* take(size_t bytes) {
    const size_t begin = used_;
    used_ += (bytes + kAlignment - 1) / kAlignment * kAlignment;
    most_ = std::max(most_, used_);
    if (counts_) return nullptr;
    if (used_ > bytes_)
      throw Error(ErrorCode::kInvalidArgument, "scratch memory has " + std::to_string(bytes_) +
                                                   " bytes, but " + std::to_string(used_) +
                                                   " are needed already");
    UMBEL_POISON(memory_ + begin, used_ - begin);
    return memory_ + begin;
  }

  size_t used() const { return used_; }
  /// Makes room again from `begin` on, if what lies there ends where the free room starts. What
  /// does not stays taken.
  void give_back(size_t begin, size_t end) {
    if (used_ != end) return;
    used_ = begin;
    if (!counts_) UMBEL_POISON(memory_ + begin, end - begin);
  }

 private:
  char* memory_ = nullptr;
  size_t bytes_ = 0, used_ = 0, most_ = 0;
  bool counts_ = true;
};

/// `size` elements without a value in an arena, given back at the end of the scope. Work that was
/// put into a stream before may still use them: what takes their place is put into the same stream.
template <typename T>
class ArenaBuffer {
  static_assert(std::is_trivially_copyable_v<T>);

 public:
  ArenaBuffer() = default;
  ArenaBuffer(Arena& arena, size_t size) : arena_(&arena), size_(size), begin_(arena.used()) {
    data_ = static_cast<T*>(arena.take(size * sizeof(T)));
    end_ = arena.used();
  }
  ArenaBuffer(ArenaBuffer&& o) noexcept { swap(o); }
  ArenaBuffer& operator=(ArenaBuffer&& o) noexcept {
    swap(o);
    return *this;
  }
  ~ArenaBuffer() {
    if (arena_) arena_->give_back(begin_, end_);
  }

  T* data() const { return data_; }
  size_t size() const { return size_; }

 private:
  void swap(ArenaBuffer& o) noexcept {
    std::swap(arena_, o.arena_);
    std::swap(data_, o.data_);
    std::swap(size_, o.size_);
    std::swap(begin_, o.begin_);
    std::swap(end_, o.end_);
  }

  Arena* arena_ = nullptr;
  T* data_ = nullptr;
  size_t size_ = 0, begin_ = 0, end_ = 0;
};

}  // namespace umbel::cuda
