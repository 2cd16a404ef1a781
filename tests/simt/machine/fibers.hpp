// Fibers, and what ThreadSanitizer is told of them. Without it they are fibers alone.
#pragma once

#include <ucontext.h>

#include <cstddef>

#if defined(__x86_64__)
/// Saves what a call preserves and the stack of the caller to *from, and goes on with that of `to`.
/// swapcontext would ask the system twice each time.
extern "C" void umbel_simt_switch(void** from, void* to);
#endif

extern "C" void __tsan_volatile_read4(void* address);
// Absent (null) where the program is built without it.
extern "C" {
__attribute__((weak)) void* __tsan_get_current_fiber();
__attribute__((weak)) void* __tsan_create_fiber(unsigned flags);
__attribute__((weak)) void __tsan_switch_to_fiber(void* fiber, unsigned flags);
__attribute__((weak)) void __tsan_acquire(void* address);
__attribute__((weak)) void __tsan_release(void* address);
}

namespace umbel::simt {

/// What one fiber releases at a tag, another sees after it acquires there.
inline void acquire(void* tag) {
  if (__tsan_acquire) __tsan_acquire(tag);
}
inline void release(void* tag) {
  if (__tsan_release) __tsan_release(tag);
}

/// The stack and the registers of one flow of control; switching orders no memory.
class Fiber {
 public:
  /// The one that runs.
  Fiber() : sanitized_(__tsan_get_current_fiber ? __tsan_get_current_fiber() : nullptr) {}
  /// One that begins with main(), which must not return.
  explicit Fiber(void (*main)());
  Fiber(const Fiber&) = delete;
  Fiber& operator=(const Fiber&) = delete;

  void switch_to(Fiber& other) {
    // 1: without an order of memory.
    if (__tsan_switch_to_fiber) __tsan_switch_to_fiber(other.sanitized_, 1);
#if defined(__x86_64__)
    umbel_simt_switch(&stack_, other.stack_);
#else
    swapcontext(&context_, &other.context_);
#endif
  }

 private:
#if defined(__x86_64__)
  void* stack_ = nullptr;
#else
  ucontext_t context_;
#endif
  void* sanitized_;
};

}  // namespace umbel::simt
