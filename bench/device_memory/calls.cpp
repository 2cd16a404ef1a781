// See counts.hpp. Compiled without -fsanitize=thread, whose calls these are.
#include <pthread.h>

#include <atomic>
#include <memory>
#include <unordered_map>

#include "counts.hpp"

namespace bench {
namespace {

/// In which kernel each sector of a part of memory was last read and written.
struct Page {
  static constexpr uintptr_t kBits = 16;

  uint32_t read[(1u << kBits) / kSector] = {}, written[(1u << kBits) / kSector] = {};
};

class Counter {
 public:
  void begin(uint64_t launches) {
    if (stack_end_ == 0) find_stack();
    counts_ = {};
    counts_.launches = launches;
    of_thread_ = 0;
    ++kernel_;
    is_on_ = true;
  }
  void begin_thread() { of_thread_ = 0; }
  KernelCounts end() {
    is_on_ = false;
    passed_over_ = passed_over_end_ = 0;
    return counts_;
  }
  void pass_over(const void* begin, uint64_t bytes) {
    passed_over_ = reinterpret_cast<uintptr_t>(begin);
    passed_over_end_ = passed_over_ + bytes;
  }
  void count_arrays(uint64_t read, uint64_t written) {
    counts_.words_read += read / 4;
    counts_.words_written += written / 4;
    counts_.bytes += read + written;
  }

  void access(const volatile void* address, uint64_t bytes, bool writes) {
    const auto begin = reinterpret_cast<uintptr_t>(address);
    if (!counts(begin)) return;
    const uint64_t words = (bytes + 3) / 4;
    (writes ? counts_.words_written : counts_.words_read) += words;
    lengthen(words);
    touch(begin, bytes, !writes, writes);
  }
  void atomic(const volatile void* address, uint64_t bytes) {
    const auto begin = reinterpret_cast<uintptr_t>(address);
    if (!counts(begin)) return;
    ++counts_.atomics;
    lengthen(1);
    touch(begin, bytes, true, true);
  }

 private:
  bool counts(uintptr_t at) const {
    return is_on_ && !(at >= stack_ && at < stack_end_) &&
           !(at >= passed_over_ && at < passed_over_end_);
  }
  void lengthen(uint64_t words) {
    of_thread_ += words;
    if (of_thread_ > counts_.longest) counts_.longest = of_thread_;
  }
  void touch(uintptr_t begin, uint64_t bytes, bool reads, bool writes) {
    for (uintptr_t s = begin / kSector; s <= (begin + bytes - 1) / kSector; ++s) {
      const uintptr_t name = s * kSector >> Page::kBits;
      Recent& recent = recent_[name % kRecent];
      if (!recent.page || recent.name != name) {
        std::unique_ptr<Page>& page = pages_[name];
        if (!page) page = std::make_unique<Page>();
        recent = {name, page.get()};
      }
      Page& page = *recent.page;
      const uintptr_t at = s % ((uintptr_t{1} << Page::kBits) / kSector);
      const bool is_known = page.read[at] == kernel_ || page.written[at] == kernel_;
      if (reads && !is_known) {
        page.read[at] = kernel_;
        counts_.bytes += kSector;
      }
      if (writes && page.written[at] != kernel_) {
        page.written[at] = kernel_;
        counts_.bytes += kSector;
      }
    }
  }
  /// What is there is in registers on a device, or at least in the thread's own memory.
  void find_stack() {
    pthread_attr_t attributes;
    pthread_getattr_np(pthread_self(), &attributes);
    void* low = nullptr;
    size_t size = 0;
    pthread_attr_getstack(&attributes, &low, &size);
    pthread_attr_destroy(&attributes);
    stack_ = reinterpret_cast<uintptr_t>(low);
    stack_end_ = stack_ + size;
  }

  bool is_on_ = false;
  uint32_t kernel_ = 0;
  KernelCounts counts_;
  uint64_t of_thread_ = 0;
  uintptr_t stack_ = 0, stack_end_ = 0, passed_over_ = 0, passed_over_end_ = 0;
  std::unordered_map<uintptr_t, std::unique_ptr<Page>> pages_;
  struct Recent {
    uintptr_t name = 0;
    Page* page = nullptr;
  };
  static constexpr size_t kRecent = 1 << 14;
  Recent recent_[kRecent];
};

Counter& counter() {
  static Counter the_one;
  return the_one;
}

}  // namespace

void begin_kernel(uint64_t launches) { counter().begin(launches); }
void begin_thread() { counter().begin_thread(); }
void count_arrays(uint64_t read, uint64_t written) { counter().count_arrays(read, written); }
void pass_over(const void* begin, uint64_t bytes) { counter().pass_over(begin, bytes); }
KernelCounts end_kernel() { return counter().end(); }

namespace {
void load(const volatile void* a, uint64_t bytes) { counter().access(a, bytes, false); }
void store(const volatile void* a, uint64_t bytes) { counter().access(a, bytes, true); }
}  // namespace
}  // namespace bench

// NOLINTBEGIN(bugprone-reserved-identifier,readability-identifier-naming,bugprone-macro-parentheses)
extern "C" {

void __tsan_init() {}
void __tsan_func_entry(void*) {}
void __tsan_func_exit() {}
void __tsan_vptr_update(void**, void*) {}
void __tsan_vptr_read(void**) {}
void __tsan_read_range(void* a, unsigned long bytes) {
  if (bytes > 0) bench::load(a, bytes);
}
void __tsan_write_range(void* a, unsigned long bytes) {
  if (bytes > 0) bench::store(a, bytes);
}

#define ACCESSES(bytes)                                                 \
  void __tsan_read##bytes(void* a) { bench::load(a, bytes); }           \
  void __tsan_write##bytes(void* a) { bench::store(a, bytes); }         \
  void __tsan_unaligned_read##bytes(void* a) { bench::load(a, bytes); } \
  void __tsan_unaligned_write##bytes(void* a) { bench::store(a, bytes); }
ACCESSES(1)
ACCESSES(2)
ACCESSES(4)
ACCESSES(8)
ACCESSES(16)

#define UPDATE(bits, Word, name)                                         \
  Word __tsan_atomic##bits##_##name(volatile Word* a, Word value, int) { \
    bench::counter().atomic(a, sizeof(Word));                            \
    return __atomic_##name(a, value, __ATOMIC_SEQ_CST);                  \
  }
#define ATOMICS(bits, Word)                                                                       \
  Word __tsan_atomic##bits##_load(const volatile Word* a, int) {                                  \
    bench::load(a, sizeof(Word));                                                                 \
    return __atomic_load_n(a, __ATOMIC_SEQ_CST);                                                  \
  }                                                                                               \
  void __tsan_atomic##bits##_store(volatile Word* a, Word value, int) {                           \
    bench::store(a, sizeof(Word));                                                                \
    __atomic_store_n(a, value, __ATOMIC_SEQ_CST);                                                 \
  }                                                                                               \
  Word __tsan_atomic##bits##_exchange(volatile Word* a, Word value, int) {                        \
    bench::counter().atomic(a, sizeof(Word));                                                     \
    return __atomic_exchange_n(a, value, __ATOMIC_SEQ_CST);                                       \
  }                                                                                               \
  UPDATE(bits, Word, fetch_add)                                                                   \
  UPDATE(bits, Word, fetch_sub)                                                                   \
  UPDATE(bits, Word, fetch_and)                                                                   \
  UPDATE(bits, Word, fetch_or)                                                                    \
  int __tsan_atomic##bits##_compare_exchange_strong(volatile Word* a, Word* old, Word value, int, \
                                                    int) {                                        \
    bench::counter().atomic(a, sizeof(Word));                                                     \
    return __atomic_compare_exchange_n(a, old, value, false, __ATOMIC_SEQ_CST, __ATOMIC_SEQ_CST); \
  }                                                                                               \
  int __tsan_atomic##bits##_compare_exchange_weak(volatile Word* a, Word* old, Word value, int,   \
                                                  int) {                                          \
    bench::counter().atomic(a, sizeof(Word));                                                     \
    return __atomic_compare_exchange_n(a, old, value, true, __ATOMIC_SEQ_CST, __ATOMIC_SEQ_CST);  \
  }
ATOMICS(8, unsigned char)
ATOMICS(16, unsigned short)
ATOMICS(32, unsigned)
ATOMICS(64, unsigned long)

void __tsan_atomic_thread_fence(int) {}
void __tsan_atomic_signal_fence(int) {}
}
// NOLINTEND(bugprone-reserved-identifier,readability-identifier-naming,bugprone-macro-parentheses)
