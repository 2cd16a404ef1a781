// The parallel primitives over which an algorithm is written once for CPU and GPU: a function
// template over an executor, which takes raw pointers and function objects marked
// UMBEL_HOST_DEVICE or UMBEL_DEVICE_LAMBDA, and keeps every intermediate in the executor's buffers.
//
// Results do not depend on the number of threads. They are the same bytes on every executor as
// long as what is given to `reduce` is exactly associative (minima, maxima, integer sums).
#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <utility>

#include "base/cpu_buffer.hpp"
#include "base/host_device.hpp"
#include "base/parallel.hpp"
#include "base/radix_sort_pairs.hpp"
#include "base/team.hpp"

/// Before a loop that is to leave no index behind that is not a constant, so that arrays stay in
/// registers.
#if defined(__CUDA_ARCH__) && !defined(UMBEL_SIMT)
#define UMBEL_UNROLL _Pragma("unroll")
#else
#define UMBEL_UNROLL
#endif

namespace umbel {

#if defined(__CUDA_ARCH__) && !defined(UMBEL_ADD_RELEASE)
/// Adds to a counter in global memory, after all that the thread wrote before.
__device__ inline uint32_t add_release(uint32_t* counter, uint32_t amount) {
  uint32_t old;
  asm volatile("atom.add.release.gpu.global.u32 %0, [%1], %2;"
               : "=r"(old)
               : "l"(__cvta_generic_to_global(counter)), "r"(amount)
               : "memory");
  return old;
}
/// Exchanges a word in global memory, after all that the thread wrote before.
__device__ inline uint64_t exchange_release(uint64_t* word, uint64_t value) {
  uint64_t old;
  asm volatile("atom.exch.release.gpu.global.b64 %0, [%1], %2;"
               : "=l"(old)
               : "l"(__cvta_generic_to_global(word)), "l"(value)
               : "memory");
  return old;
}
/// What others released before the thread's last atomic operation is seen from here on. Less than
/// __threadfence(), which puts all fences of all threads in one order.
__device__ inline void acquire() { asm volatile("fence.acq_rel.gpu;" ::: "memory"); }
// The emulator of tests/simt has its own.
#define UMBEL_ADD_RELEASE(counter, amount) ::umbel::add_release(counter, amount)
#define UMBEL_EXCHANGE_RELEASE(word, value) ::umbel::exchange_release(word, value)
#define UMBEL_ACQUIRE() ::umbel::acquire()
#endif

/// Counts an arrival where several threads arrive, each once: true for the one after `others`
/// more, which then sees what the others wrote before they arrived. Only that one pays for an
/// acquire.
UMBEL_HOST_DEVICE inline bool is_last_to_arrive(uint32_t* counter, uint32_t others) {
#if defined(__CUDA_ARCH__)
  if (UMBEL_ADD_RELEASE(counter, 1) != others) return false;
  UMBEL_ACQUIRE();
  return true;
#else
  return std::atomic_ref<uint32_t>(*counter).fetch_add(1, std::memory_order_acq_rel) == others;
#endif
}

/// Where two threads meet that each know something, no more than a word: false for the first one,
/// which leaves its word. The second one gets that, and sees what the first one wrote before. The
/// place is kNobodyMet at first, which is no word of theirs.
inline constexpr uint64_t kNobodyMet = ~uint64_t{0};
UMBEL_HOST_DEVICE inline bool is_second_to_meet(uint64_t* place, uint64_t own, uint64_t& other) {
#if defined(__CUDA_ARCH__)
  other = UMBEL_EXCHANGE_RELEASE(place, own);
  if (other == kNobodyMet) return false;
  UMBEL_ACQUIRE();
  return true;
#else
  other = std::atomic_ref<uint64_t>(*place).exchange(own, std::memory_order_acq_rel);
  return other != kNobodyMet;
#endif
}

/// As atomic_add of 1, to count what was found: nothing is said of other memory. Lanes of a warp
/// that come here together cost one operation a counter.
UMBEL_HOST_DEVICE inline uint32_t atomic_count(uint32_t* counter) {
#if defined(__CUDA_ARCH__)
  const uint32_t together =
      __match_any_sync(__activemask(), reinterpret_cast<unsigned long long>(counter));
  const uint32_t lane = threadIdx.x % 32;
  const int first = __ffs(int(together)) - 1;
  uint32_t old = 0;
  if (int(lane) == first) old = atomicAdd(counter, uint32_t(__popc(together)));
  return __shfl_sync(together, old, first) + __popc(together & ((1u << lane) - 1));
#else
  return std::atomic_ref<uint32_t>(*counter).fetch_add(1, std::memory_order_relaxed);
#endif
}

/// *word |= bits, for a word that several threads share.
UMBEL_HOST_DEVICE inline void atomic_or(uint32_t* word, uint32_t bits) {
#if defined(__CUDA_ARCH__)
  atomicOr(word, bits);
#else
  std::atomic_ref<uint32_t>(*word).fetch_or(bits, std::memory_order_relaxed);
#endif
}

/// *sum += amount, for an integer that several threads share. Nothing is said of other memory.
template <typename T>
UMBEL_HOST_DEVICE inline void atomic_sum(T* sum, T amount) {
#if defined(__CUDA_ARCH__)
  using Unsigned = std::conditional_t<sizeof(T) == 8, unsigned long long, unsigned>;
  atomicAdd(reinterpret_cast<Unsigned*>(sum), static_cast<Unsigned>(amount));
#else
  std::atomic_ref<T>(*sum).fetch_add(amount, std::memory_order_relaxed);
#endif
}

/// *word = max(*word, value), for a word that several threads share.
UMBEL_HOST_DEVICE inline void atomic_max(uint32_t* word, uint32_t value) {
#if defined(__CUDA_ARCH__)
  // Most have been there before; an old value that is read costs an operation at most.
  if (*const_cast<volatile uint32_t*>(word) < value) atomicMax(word, value);
#else
  const std::atomic_ref<uint32_t> shared(*word);
  uint32_t seen = shared.load(std::memory_order_relaxed);
  while (seen < value && !shared.compare_exchange_weak(seen, value, std::memory_order_relaxed)) {
  }
#endif
}

/// The executor on the processor's cores, by oneTBB.
class CpuExec {
 public:
  static constexpr bool kSerialTeams = true;  ///< teams are single threads

  template <typename T>
  using Buffer = CpuBuffer<T>;

  template <typename T>
  Buffer<T> allocate(size_t size) {
    return Buffer<T>(size);
  }

  /// Whether nothing is run, and only the need of memory is found out: `read` gives 0 then.
  static constexpr bool counts() { return false; }

  /// The value at an address of this executor's memory, once all work before is done. The only
  /// member that waits.
  template <typename T>
  T read(const T* value) {
    return *value;
  }

  /// body(i) for i in [0, n), in any order; one thread does at least `grain` of them.
  template <typename Body>
  void for_each(size_t n, const Body& body, size_t grain = kGrain) {
    parallel_for(n, grain, body);
  }

  /// body(i) for i in [0, each * min(*count, most)), in any order, where the count is in the
  /// executor's memory.
  template <typename Body>
  void for_each_of(const uint32_t* count, uint32_t most, uint32_t each, const Body& body) {
    for_each(size_t(each) * std::min(*count, most), body);
  }

  /// Layers of work; each says how much there is in the next one: for layer 0, 1, ...
  /// while counts[layer] is not 0, at most `layers` of them, body(layer, i) for i in [0, each *
  /// min(counts[layer], most)), in any order. The counts are in the executor's memory.
  template <typename Body>
  void for_each_layer(const uint32_t* counts, uint32_t layers, uint32_t most, uint32_t each,
                      const Body& body) {
    for (uint32_t layer = 0; layer < layers && counts[layer] > 0; ++layer)
      for_each(size_t(each) * std::min(counts[layer], most),
               [&, layer](size_t i) { body(layer, i); });
  }

  /// The same with teams of 8 lanes: body(team, layer, i, shared) for i in [0, min(counts[layer],
  /// most)). See base/team.hpp.
  template <typename Body>
  void for_each_layer_team(const uint32_t* counts, uint32_t layers, uint32_t most,
                           const Body& body) {
    using Shared = typename Body::Shared;
    for (uint32_t layer = 0; layer < layers && counts[layer] > 0; ++layer)
      parallel_chunks(std::min(counts[layer], most), kTeams, [&](size_t begin, size_t end) {
        const Buffer<Shared> shared(1);
        for (size_t i = begin; i < end; ++i) body(SerialTeam{}, layer, i, *shared.data());
      });
  }

  /// For i in [0, n), in any order, what takes many steps, and not equally many:
  ///     Body::State state;
  ///     if (body.begin(i, state)) while (body.step(state)) {}
  ///     body.end(i, state);
  template <typename Body>
  void for_each_traversal(size_t n, const Body& body) {
    parallel_for(n, kWalks, [&](size_t i) {
      typename Body::State state;
      if (body.begin(i, state))
        while (body.step(state)) {
        }
      body.end(i, state);
    });
  }

  /// body(team, i, shared) for i in [0, n), in any order. See base/team.hpp.
  template <typename Body>
  void for_each_team(size_t n, const Body& body) {
    using Shared = typename Body::Shared;
    parallel_chunks(n, kTeams, [&](size_t begin, size_t end) {
      const Buffer<Shared> shared(1);
      for (size_t i = begin; i < end; ++i) body(SerialTeam{}, i, *shared.data());
    });
  }

  /// body(team, i, shared) for i in [0, min(*count, most)), in any order, where the count is in the
  /// executor's memory.
  template <typename Body>
  void for_each_team_of(const uint32_t* count, uint32_t most, const Body& body) {
    for_each_team(std::min(*count, most), body);
  }

  /// *result = op(... op(op(init, map(0)), map(1)) ..., map(n - 1)). Each map(i) is called once, so
  /// it may write what belongs to i.
  template <typename T, typename Map, typename Op>
  void reduce(size_t n, T init, const Map& map, const Op& op, T* result) {
    Buffer<T> partial(chunks(n));
    each_chunk(n, [&](size_t chunk, size_t begin, size_t end) {
      T value = map(begin);
      for (size_t i = begin + 1; i < end; ++i) value = op(value, map(i));
      partial[chunk] = value;
    });
    T value = init;
    for (size_t c = 0; c < partial.size(); ++c) value = op(value, partial[c]);
    *result = value;
  }

  /// out[i] = in(0) + ... + in(i - 1) for i in [0, n]: n + 1 elements, the last one the total.
  /// in(i) may read out[i].
  template <typename T, typename In>
  void exclusive_scan(size_t n, const In& in, T* out) {
    Buffer<T> sums(chunks(n));
    each_chunk(n, [&](size_t chunk, size_t begin, size_t end) {
      T sum = 0;
      for (size_t i = begin; i < end; ++i) sum += in(i);
      sums[chunk] = sum;
    });
    T total = 0;
    for (size_t c = 0; c < sums.size(); ++c) total += std::exchange(sums[c], total);
    each_chunk(n, [&](size_t chunk, size_t begin, size_t end) {
      T sum = sums[chunk];
      for (size_t i = begin; i < end; ++i) {
        const T value = in(i);
        out[i] = sum;
        sum += value;
      }
    });
    out[n] = total;
  }

  /// Writes the i in [0, n) for which keep(i) holds, ascending, and how many there are.
  template <typename Keep>
  void select(size_t n, const Keep& keep, uint32_t* out, uint32_t* count) {
    Buffer<uint32_t> starts(chunks(n));
    each_chunk(n, [&](size_t chunk, size_t begin, size_t end) {
      uint32_t kept = 0;
      for (size_t i = begin; i < end; ++i) kept += keep(i) ? 1u : 0u;
      starts[chunk] = kept;
    });
    uint32_t total = 0;
    for (size_t c = 0; c < starts.size(); ++c) total += std::exchange(starts[c], total);
    each_chunk(n, [&](size_t chunk, size_t begin, size_t end) {
      uint32_t at = starts[chunk];
      for (size_t i = begin; i < end; ++i)
        if (keep(i)) out[at++] = static_cast<uint32_t>(i);
    });
    *count = total;
  }

  /// Where runs of equal neighbours begin: starts[0, *runs), and starts[*runs] = n. `starts` has
  /// room for n + 1.
  template <typename Key>
  void run_length(size_t n, const Key* keys, uint32_t* starts, uint32_t* runs) {
    select(n, [=](size_t i) { return i == 0 || keys[i] != keys[i - 1]; }, starts, runs);
    starts[*runs] = static_cast<uint32_t>(n);
  }

  /// Sorts pairs by bits [first_bit, last_bit) of their keys; equal ones keep their order.
  template <typename Key>
  void radix_sort_pairs(size_t n, Key* keys, uint32_t* values, uint32_t first_bit,
                        uint32_t last_bit) {
    Buffer<KeyAndValue<Key>> items(n);
    umbel::radix_sort_pairs(n, keys, values, first_bit, last_bit, items.data());
  }

 private:
  static constexpr size_t kGrain = 1024;
  static constexpr size_t kWalks = 64;
  static constexpr size_t kTeams = 16;  // in turn, with the same memory
  static constexpr size_t kChunk = 8192;

  static size_t chunks(size_t n) { return (n + kChunk - 1) / kChunk; }

  template <typename Body>
  static void each_chunk(size_t n, const Body& body) {
    parallel_for(chunks(n), 1, [&](size_t chunk) {
      body(chunk, chunk * kChunk, std::min(n, (chunk + 1) * kChunk));
    });
  }
};

}  // namespace umbel
