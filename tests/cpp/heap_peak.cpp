#include "heap_peak.hpp"

#include <algorithm>
#include <atomic>
#include <cstdlib>
#include <new>

// Sanitizers have an operator new of their own, some forms of which would stay theirs.
#if defined(__GLIBC__) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define UMBEL_COUNTS_HEAP 1
#include <malloc.h>
#endif

namespace {

std::atomic<size_t> in_use{0}, peak{0};
thread_local long until_failure = -1;  // allocations; negative: none fails

#ifdef UMBEL_COUNTS_HEAP
void* counted(void* memory) {
  if (until_failure >= 0 && until_failure-- == 0) {
    std::free(memory);
    memory = nullptr;
  }
  if (!memory) throw std::bad_alloc();
  const size_t now = in_use += malloc_usable_size(memory);
  size_t most = peak.load(std::memory_order_relaxed);
  while (most < now && !peak.compare_exchange_weak(most, now)) {
  }
  return memory;
}

void give_back(void* memory) {
  if (memory) in_use -= malloc_usable_size(memory);
  std::free(memory);
}

void* aligned(size_t size, std::align_val_t alignment) {
  const auto step = std::max(static_cast<size_t>(alignment), sizeof(void*));
  return counted(std::aligned_alloc(step, (size + step - 1) / step * step));
}

#endif

}  // namespace

#ifdef UMBEL_COUNTS_HEAP
void* operator new(size_t size) { return counted(std::malloc(std::max<size_t>(size, 1))); }
void* operator new[](size_t size) { return counted(std::malloc(std::max<size_t>(size, 1))); }
void* operator new(size_t size, std::align_val_t alignment) { return aligned(size, alignment); }
void* operator new[](size_t size, std::align_val_t alignment) { return aligned(size, alignment); }
void operator delete(void* memory) noexcept { give_back(memory); }
void operator delete[](void* memory) noexcept { give_back(memory); }
void operator delete(void* memory, size_t) noexcept { give_back(memory); }
void operator delete[](void* memory, size_t) noexcept { give_back(memory); }
void operator delete(void* memory, std::align_val_t) noexcept { give_back(memory); }
void operator delete[](void* memory, std::align_val_t) noexcept { give_back(memory); }
void operator delete(void* memory, size_t, std::align_val_t) noexcept { give_back(memory); }
void operator delete[](void* memory, size_t, std::align_val_t) noexcept { give_back(memory); }
#endif

namespace umbel::testing {

HeapPeak::HeapPeak() : before_(in_use) { peak = before_; }

bool HeapPeak::counts() {
#ifdef UMBEL_COUNTS_HEAP
  return true;
#else
  return false;
#endif
}

size_t HeapPeak::bytes() const { return peak - before_; }

FailingAllocation::FailingAllocation(size_t others) { until_failure = static_cast<long>(others); }
FailingAllocation::~FailingAllocation() { until_failure = -1; }
bool FailingAllocation::has_failed() const { return until_failure < 0; }

}  // namespace umbel::testing
