// Stable parallel radix sort of keys with 32-bit values.
//
// The first passes go from the most significant digit down and split the input into buckets that
// fit into the cache; there the next two digits are sorted from the least significant up, which
// tells most keys apart, and what is still tied is sorted run by run. So a long key costs little
// more than its distinguishing bits, and memory is passed over twice instead of once a digit.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "base/cpu_buffer.hpp"
#include "base/parallel.hpp"

namespace umbel {

template <typename Key>
struct KeyAndValue {
  Key key;
  uint32_t value;
};

namespace detail {

inline constexpr uint32_t kDigitBits = 11;
inline constexpr size_t kCached = size_t(1) << 15;  // pairs that are sorted within the cache
inline constexpr size_t kBuckets = size_t(1) << kDigitBits;
using Histogram = std::array<uint32_t, kBuckets>;

/// Bits [first, last) of a key.
struct BitRange {
  uint32_t first, last;
  uint32_t size() const { return last - first; }
  template <typename Key>
  Key of(Key key) const {
    return static_cast<Key>(key >> first) & static_cast<Key>((uint64_t(2) << (size() - 1)) - 1);
  }
};

/// Where sorted pairs are written.
template <typename Key>
struct PairOutput {
  Key* keys;
  uint32_t* values;
  void write(size_t i, const KeyAndValue<Key>& item) const {
    keys[i] = item.key;
    values[i] = item.value;
  }
  PairOutput operator+(size_t offset) const { return {keys + offset, values + offset}; }
};

/// Where pairs are read from.
template <typename Key>
struct PairInput {
  const Key* keys;
  const uint32_t* values;
  KeyAndValue<Key> operator()(size_t i) const { return {keys[i], values[i]}; }
};
template <typename Key>
struct ItemInput {
  const KeyAndValue<Key>* items;
  const KeyAndValue<Key>& operator()(size_t i) const { return items[i]; }
};

inline void counts_to_offsets(uint32_t* counts, size_t size) {
  uint32_t sum = 0;
  for (size_t i = 0; i < size; ++i) sum += std::exchange(counts[i], sum);
}

template <typename Key>
void insertion_sort(KeyAndValue<Key>* items, size_t count, BitRange bits) {
  for (size_t i = 1; i < count; ++i) {
    const KeyAndValue<Key> item = items[i];
    const Key key = bits.of(item.key);
    size_t at = i;
    for (; at > 0 && bits.of(items[at - 1].key) > key; --at) items[at] = items[at - 1];
    items[at] = item;
  }
}

/// Scratch memory for kCached pairs, which a thread keeps for its next bucket.
template <typename Key>
KeyAndValue<Key>* spare_items() {
  thread_local CpuBuffer<KeyAndValue<Key>> spare;
  if (spare.size() == 0) spare = CpuBuffer<KeyAndValue<Key>>(kCached);
  return spare.data();
}

/// One pass by a digit into `out`; `offsets` holds the digit's counts.
template <typename Key>
void scatter(const KeyAndValue<Key>* items, size_t count, BitRange digit, uint32_t* offsets,
             KeyAndValue<Key>* out) {
  counts_to_offsets(offsets, size_t(1) << digit.size());
  for (size_t i = 0; i < count; ++i) out[offsets[digit.of(items[i].key)]++] = items[i];
}

/// Sorts what fits into the cache; `items` and `spare` are used up.
template <typename Key>
void sort_in_cache(KeyAndValue<Key>* items, KeyAndValue<Key>* spare, size_t count, BitRange bits,
                   PairOutput<Key> out) {
  constexpr size_t kFew = 24;
  if (count > kFew && bits.size() > 0) {
    const uint32_t most = count < 2048 ? 8 : kDigitBits;
    const uint32_t used = std::min(bits.size(), 2 * most), low_size = used / 2;
    const BitRange high{bits.last - (used - low_size), bits.last};
    const BitRange low{bits.last - used, bits.last - used + low_size};
    const BitRange rest{bits.first, low.first};
    Histogram low_counts, high_counts;
    std::fill_n(low_counts.begin(), size_t(1) << low_size, 0u);
    std::fill_n(high_counts.begin(), size_t(1) << high.size(), 0u);
    for (size_t i = 0; i < count; ++i) {
      if (low_size > 0) ++low_counts[low.of(items[i].key)];
      ++high_counts[high.of(items[i].key)];
    }
    if (low_size > 0) {
      scatter(items, count, low, low_counts.data(), spare);
      std::swap(items, spare);
    }
    scatter(items, count, high, high_counts.data(), spare);
    std::swap(items, spare);
    if (rest.size() > 0) {
      const BitRange sorted{low.first, bits.last};
      for (size_t begin = 0; begin < count;) {
        size_t end = begin + 1;
        const Key key = sorted.of(items[begin].key);
        while (end < count && sorted.of(items[end].key) == key) ++end;
        if (end - begin > kFew)
          sort_in_cache(items + begin, spare + begin, end - begin, rest, out + begin);
        else if (end - begin > 1)
          insertion_sort(items + begin, end - begin, rest);
        if (end - begin <= kFew)
          for (size_t i = begin; i < end; ++i) out.write(i, items[i]);
        begin = end;
      }
      return;
    }
  } else if (count > 1 && bits.size() > 0) {
    insertion_sort(items, count, bits);
  }
  for (size_t i = 0; i < count; ++i) out.write(i, items[i]);
}

/// Splits source(0), ... source(count - 1) by the highest digit into `items`, then sorts each
/// bucket.
template <typename Key, typename Source>
void sort_by_buckets(Source source, size_t count, BitRange bits, KeyAndValue<Key>* items,
                     PairOutput<Key> out) {
  using Item = KeyAndValue<Key>;
  constexpr size_t kChunk = size_t(1) << 16;
  if (count <= kCached || bits.size() == 0) {
    for (size_t i = 0; i < count; ++i) items[i] = source(i);
    sort_in_cache(items, spare_items<Key>(), count, bits, out);
    return;
  }
  const BitRange digit{bits.last - std::min(bits.size(), kDigitBits), bits.last};
  const BitRange rest{bits.first, digit.first};
  const size_t buckets = size_t(1) << digit.size();
  const size_t chunk = std::max(kChunk, (count + 63) / 64);
  std::vector<Histogram> counts((count + chunk - 1) / chunk);
  parallel_chunks(count, chunk, [&](size_t begin, size_t end) {
    Histogram& histogram = counts[begin / chunk];
    histogram.fill(0);
    for (size_t i = begin; i < end; ++i) ++histogram[digit.of(source(i).key)];
  });
  std::vector<size_t> starts(buckets + 1);
  size_t sum = 0;
  for (size_t b = 0; b < buckets; ++b) {
    starts[b] = sum;
    for (Histogram& histogram : counts) sum += std::exchange(histogram[b], uint32_t(sum));
  }
  starts[buckets] = sum;
  parallel_chunks(count, chunk, [&](size_t begin, size_t end) {
    Histogram& offsets = counts[begin / chunk];
    for (size_t i = begin; i < end; ++i) {
      const Item item = source(i);
      items[offsets[digit.of(item.key)]++] = item;
    }
  });
  parallel_for(buckets, 8, [&](size_t b) {
    const size_t begin = starts[b], size = starts[b + 1] - begin;
    if (size == 0) return;
    if (size <= kCached) {
      sort_in_cache(items + begin, spare_items<Key>(), size, rest, out + begin);
    } else {
      const CpuBuffer<Item> spare(size);
      sort_by_buckets(ItemInput<Key>{items + begin}, size, rest, spare.data(), out + begin);
    }
  });
}

}  // namespace detail

/// Sorts by bits [first_bit, last_bit) of the keys; `items` is scratch memory for n.
template <typename Key>
void radix_sort_pairs(size_t n, Key* keys, uint32_t* values, uint32_t first_bit, uint32_t last_bit,
                      KeyAndValue<Key>* items) {
  if (n < 2 || last_bit <= first_bit) return;
  detail::sort_by_buckets(detail::PairInput<Key>{keys, values}, n,
                          detail::BitRange{first_bit, last_bit}, items,
                          detail::PairOutput<Key>{keys, values});
}

}  // namespace umbel
