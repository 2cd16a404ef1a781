#include "fibers.hpp"

#include <sys/mman.h>

#include <cstdio>
#include <cstdlib>

#if defined(__x86_64__)
asm(R"(
.text
.globl umbel_simt_switch
.type umbel_simt_switch, @function
umbel_simt_switch:
  pushq %rbp
  pushq %rbx
  pushq %r12
  pushq %r13
  pushq %r14
  pushq %r15
  movq %rsp, (%rdi)
  movq %rsi, %rsp
  popq %r15
  popq %r14
  popq %r13
  popq %r12
  popq %rbx
  popq %rbp
  ret
.size umbel_simt_switch, .-umbel_simt_switch
)");
#endif

namespace umbel::simt {

Fiber::Fiber(void (*main)()) : sanitized_(__tsan_create_fiber ? __tsan_create_fiber(0) : nullptr) {
  // Fibers last as long as the program, and so do their stacks; the first page is a guard.
  constexpr size_t kStack = 256 << 10, kPage = 4096;
  void* stack = mmap(nullptr, kStack, PROT_READ | PROT_WRITE,
                     MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
  if (stack == MAP_FAILED || mprotect(stack, kPage, PROT_NONE) != 0) {
    perror("simt: a stack");
    abort();
  }
#if defined(__x86_64__)
  // As umbel_simt_switch leaves it: six registers, where to go on, and nothing to return to.
  void** top = reinterpret_cast<void**>(static_cast<char*>(stack) + kStack) - 2;
  top[0] = reinterpret_cast<void*>(main);
  top[1] = nullptr;
  stack_ = static_cast<void*>(top - 6);
#else
  getcontext(&context_);
  context_.uc_stack.ss_sp = stack;
  context_.uc_stack.ss_size = kStack;
  context_.uc_link = nullptr;
  makecontext(&context_, main, 0);
#endif
}

}  // namespace umbel::simt

// GCC calls it before a volatile read, which races with nothing here: it stands for a read of
// a word that atomic operations write, as CUDA has no other way to say it.
extern "C" void __tsan_volatile_read4(void* /*address*/) {}
