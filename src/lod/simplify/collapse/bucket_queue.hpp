// A priority queue of small integers by a float, to within 1/16 of its value.
//
// The float's exponent and leading bits are the number of a bucket, a list that takes the newest
// first; bitmaps find the lowest one that is not empty. All operations take constant time, and the
// order depends on nothing but the calls made.
#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <vector>

#include "umbel/types.hpp"

namespace umbel::lod {

class BucketQueue {
 public:
  static constexpr uint32_t kBuckets = 4096;

  /// Keys are [0, count).
  void reset(size_t count) {
    heads_.fill(kNone);
    words_.fill(0);
    summary_ = 0;
    next_.resize(count);
    prev_.resize(count);
    bucket_.assign(count, kNone);
  }

  /// Keys are [0, count) from now on, no fewer than before.
  void extend(size_t count) {
    next_.resize(count);
    prev_.resize(count);
    bucket_.resize(count, kNone);
  }

  /// `value` >= 0. Moves the key if it is there already.
  void set(uint32_t key, float value) {
    const uint32_t b = std::bit_cast<uint32_t>(value) >> 19;
    if (bucket_[key] == b) return;
    if (bucket_[key] != kNone) remove(key);
    bucket_[key] = b;
    prev_[key] = kNone;
    next_[key] = heads_[b];
    if (heads_[b] != kNone) prev_[heads_[b]] = key;
    heads_[b] = key;
    words_[b >> 6] |= uint64_t{1} << (b & 63);
    summary_ |= uint64_t{1} << (b >> 6);
  }

  void remove(uint32_t key) {
    const uint32_t b = bucket_[key];
    if (b == kNone) return;
    bucket_[key] = kNone;
    if (next_[key] != kNone) prev_[next_[key]] = prev_[key];
    if (prev_[key] != kNone) {
      next_[prev_[key]] = next_[key];
      return;
    }
    heads_[b] = next_[key];
    if (heads_[b] != kNone) return;
    words_[b >> 6] &= ~(uint64_t{1} << (b & 63));
    if (words_[b >> 6] == 0) summary_ &= ~(uint64_t{1} << (b >> 6));
  }

  bool contains(uint32_t key) const { return bucket_[key] != kNone; }
  bool empty() const { return summary_ == 0; }

  /// A key of the lowest bucket, which is taken out.
  uint32_t pop() {
    const uint32_t word = static_cast<uint32_t>(std::countr_zero(summary_));
    const uint32_t b = word << 6 | static_cast<uint32_t>(std::countr_zero(words_[word]));
    const uint32_t key = heads_[b];
    remove(key);
    return key;
  }

 private:
  std::array<uint32_t, kBuckets> heads_;
  std::array<uint64_t, kBuckets / 64> words_;
  uint64_t summary_ = 0;  // of words_ that are not 0
  std::vector<uint32_t> next_, prev_, bucket_;
};

}  // namespace umbel::lod
