#include "machine.hpp"

#include <unistd.h>

#include <algorithm>
#include <bit>
#include <cstdio>
#include <memory>
#include <unordered_map>
#include <vector>

#include "fibers.hpp"
#include "sites.hpp"

namespace umbel::simt {

Index3 thread_index, block_index, block_size, grid_size;

namespace {

/// Most threads at a time in a launch that is not cooperative: ThreadSanitizer holds some 8000.
constexpr uint32_t kMostThreads = 512;
constexpr uint32_t kMostBlocksAtOnce = 4;
/// Of an array in a kernel, without asking for more.
constexpr size_t kMostShared = 48 << 10;
/// Among so many threads that can run, the one with the best priority does, in half of all
/// launches; otherwise any.
constexpr uint32_t kCandidates = 4;

struct Block;

struct Thread {
  Fiber fiber;
  Block* block = nullptr;
  uint32_t index = 0, priority = 0;
  const char* waits_for = nullptr;  ///< null: it can run
  bool is_done = true;
  void* last_atomic = nullptr;

  Thread();
};

/// Where threads wait for each other. Tags alternate: who leaves late must not see what those
/// release who have come again.
struct Meeting {
  uint32_t arrived = 0, phase = 0, count = 0, counts[2] = {};
  char tags[2] = {};
};

struct Lane {
  WarpOp op{};
  uint32_t mask = 0, from = 0;
  uint64_t value = 0, result = 0;
};

struct Gathering {
  uint32_t warp = 0, lanes = 0;
  const void* place = nullptr;
};

struct Warp {
  Lane lanes[kWarpLanes];
  uint32_t waiting = 0;  ///< lanes that wait for others
  /// Of lanes that meet, by the first one of them: others of the warp may meet at the same time.
  uint32_t phases[kWarpLanes] = {};
  char tags[kWarpLanes][2] = {};
  std::vector<std::unique_ptr<Gathering>> gatherings;
};

/// A place on the device for a block, and the block there.
struct Block {
  uint32_t index = 0, live = 0;
  std::vector<Thread*> threads;
  std::vector<Warp> warps;
  Meeting meeting;
  bool counts = false;  ///< what the threads at the barrier wait for
  std::unordered_map<const void*, size_t> arrays;
  size_t used = kMostShared;  ///< of the memory, by this block and, as it starts, the last one
  std::unique_ptr<unsigned char[]> memory{new unsigned char[kMostShared]};
  char begin_tag = 0, end_tag = 0;
};

/// What may run next: a thread, or lanes that gathered.
struct Runnable {
  Thread* thread = nullptr;
  Gathering* gathering = nullptr;
  Block* block = nullptr;
};

struct Grid {
  uint32_t blocks = 0, threads = 0;
  const std::function<void()>* thread = nullptr;
  bool is_cooperative = false, by_priority = false;
  Meeting meeting;
  std::vector<Runnable> runnable;
  uint32_t live = 0;  ///< threads that began and have not ended
};

/// Splitmix64: few instructions, since every switch asks for a number.
struct Generator {
  using result_type = uint64_t;  // NOLINT(readability-identifier-naming): std::shuffle's name
  uint64_t state = 0;

  static constexpr uint64_t min() { return 0; }
  static constexpr uint64_t max() { return ~uint64_t{0}; }
  uint64_t operator()() {
    uint64_t bits = state += 0x9e3779b97f4a7c15u;
    bits = (bits ^ bits >> 30) * 0xbf58476d1ce4e5b9u;
    bits = (bits ^ bits >> 27) * 0x94d049bb133111ebu;
    return bits ^ bits >> 31;
  }
};

Generator generator;
Fiber* home = nullptr;
Thread* running = nullptr;
Thread* ended = nullptr;  ///< the one that went home because it is done
Grid grid;
char end_tag;
uint32_t most_together = ~0u;
std::vector<std::unique_ptr<Block>> places;
std::vector<std::unique_ptr<Thread>> all_threads;
std::vector<Thread*> free_threads;

void describe_waiting() {
  uint32_t said = 0;
  for (const auto& place : places)
    for (const Thread* t : place->threads)
      if (!t->is_done && t->waits_for && said++ < 8)
        fprintf(stderr, "  block %u, thread %u waits for %s\n", place->index, t->index,
                t->waits_for);
  fprintf(stderr, "  %u threads of a grid of %u blocks of %u are left\n", grid.live, grid.blocks,
          grid.threads);
}

void thread_main() {
  for (;;) {
    Thread& self = *running;
    acquire(&self.block->begin_tag);
    (*grid.thread)();
    release(&self.block->end_tag);
    release(&end_tag);
    self.is_done = true;
    ended = &self;
    self.fiber.switch_to(*home);
  }
}

}  // namespace

Thread::Thread() : fiber(&thread_main) {}

namespace {

void make_runnable(Thread& t) {
  t.waits_for = nullptr;
  grid.runnable.push_back({&t, nullptr, nullptr});
}

void close_gathering(const Runnable& r);
Runnable take_next();

/// The thread that runs next; null if none can.
Thread* next_thread() {
  while (!grid.runnable.empty()) {
    const Runnable next = take_next();
    if (next.thread) return next.thread;
    close_gathering(next);
  }
  return nullptr;
}

/// Goes from `from` to a thread.
void enter(Thread& t, Fiber& from) {
  running = &t;
  thread_index = {t.index, 0, 0};
  block_index = {t.block->index, 0, 0};
  from.switch_to(t.fiber);
}

/// Lets another thread run, or goes home if none can, until somebody comes back to this one.
void stop() {
  Thread& self = *running;
  Thread* const next = next_thread();
  if (!next)
    self.fiber.switch_to(*home);
  else if (next != &self)
    enter(*next, self.fiber);
}

/// Stops the running thread until somebody makes it runnable.
void wait_for(const char* what) {
  running->waits_for = what;
  stop();
}

Warp& warp_of(const Thread& t) { return t.block->warps[t.index / kWarpLanes]; }

/// Arrives; the last of `all` wakes the others, which `members` calls its argument for.
template <typename Members>
uint32_t meet(Meeting& meeting, uint32_t all, bool flag, const char* what, const Members& members) {
  const uint32_t phase = meeting.phase;
  release(&meeting.tags[phase]);
  meeting.count += flag;
  if (++meeting.arrived == all) {
    meeting.counts[phase] = meeting.count;
    meeting.arrived = meeting.count = 0;
    meeting.phase ^= 1;
    members([](Thread& t) {
      if (&t != running) make_runnable(t);
    });
    make_runnable(*running);
    stop();
  } else {
    wait_for(what);
  }
  acquire(&meeting.tags[phase]);
  return meeting.counts[phase];
}

uint32_t meet_in_block(bool counts, bool flag) {
  Block& block = *running->block;
  if (block.meeting.arrived > 0 && block.counts != counts)
    fail("threads of a block are at barriers of two kinds");
  block.counts = counts;
  return meet(block.meeting, grid.threads, flag, "its block", [&](const auto& wake) {
    for (Thread* t : block.threads) wake(*t);
  });
}

uint32_t lanes_with(const Warp& warp, uint32_t mask, uint64_t value) {
  uint32_t found = 0;
  for (uint32_t lanes = mask; lanes != 0; lanes &= lanes - 1)
    if (warp.lanes[std::countr_zero(lanes)].value == value) found |= lanes & -lanes;
  return found;
}

/// Whether all lanes that a lane meets are there. They must agree.
bool are_all_here(const Warp& warp, uint32_t self) {
  const Lane& lane = warp.lanes[self];
  if ((warp.waiting & lane.mask) != lane.mask) return false;
  for (uint32_t lanes = lane.mask; lanes != 0; lanes &= lanes - 1) {
    const Lane& other = warp.lanes[std::countr_zero(lanes)];
    // One that waits for others alone comes later.
    if (!(other.mask >> self & 1)) return false;
    if (other.op != lane.op || other.mask != lane.mask)
      fail("lanes of a warp meet with different operations or masks");
  }
  return true;
}

/// What the operation of these lanes gives each of them.
void give_results(Warp& warp, WarpOp op, uint32_t mask) {
  const uint32_t ballot = op == WarpOp::kBallot ? lanes_with(warp, mask, 1) : 0;
  for (uint32_t lanes = mask; lanes != 0; lanes &= lanes - 1) {
    const auto l = static_cast<uint32_t>(std::countr_zero(lanes));
    Lane& to = warp.lanes[l];
    if (op == WarpOp::kSync) {
      to.result = 0;
    } else if (op == WarpOp::kBallot) {
      to.result = ballot;
    } else if (op == WarpOp::kMatch) {
      to.result = lanes_with(warp, mask, to.value);
    } else {
      const uint32_t source = (op == WarpOp::kShuffleXor ? l ^ to.from : to.from) % kWarpLanes;
      if (!(mask >> source & 1)) fail("a lane asks for the value of one that is not in the mask");
      to.result = warp.lanes[source].value;
    }
  }
}

/// Ends a gathering of lanes, or of some of them.
void close_gathering(const Runnable& r) {
  Warp& warp = r.block->warps[r.gathering->warp];
  uint32_t lanes = r.gathering->lanes;
  if (random_below(4) == 0) {
    const uint32_t some = lanes & uint32_t(generator());
    if (some) lanes = some;
  }
  for (uint32_t l = 0; l < kWarpLanes; ++l)
    if (lanes >> l & 1) {
      warp.lanes[l].result = lanes;
      make_runnable(*r.block->threads[r.gathering->warp * kWarpLanes + l]);
    }
  r.gathering->lanes &= ~lanes;
  if (r.gathering->lanes) {
    grid.runnable.push_back(r);
    return;
  }
  std::erase_if(warp.gatherings, [&](const auto& g) { return g.get() == r.gathering; });
}

void start_block(Block& place, uint32_t index) {
  place.index = index;
  place.live = grid.threads;
  place.arrays.clear();
  // Not by memset, which ThreadSanitizer would see.
  volatile unsigned char* bytes = place.memory.get();
  for (size_t i = 0; i < place.used; ++i) bytes[i] = 0xc5;
  place.used = 0;
  place.meeting.arrived = place.meeting.count = 0;
  place.warps.clear();
  place.warps.resize((grid.threads + kWarpLanes - 1) / kWarpLanes);
  place.threads.resize(grid.threads);
  release(&place.begin_tag);
  for (uint32_t i = 0; i < grid.threads; ++i) {
    if (free_threads.empty()) {
      all_threads.push_back(std::make_unique<Thread>());
      free_threads.push_back(all_threads.back().get());
    }
    std::swap(free_threads[random_below(uint32_t(free_threads.size()))], free_threads.back());
    Thread& t = *free_threads.back();
    free_threads.pop_back();
    t.block = &place;
    t.index = i;
    t.priority = uint32_t(generator());
    t.is_done = false;
    t.last_atomic = nullptr;
    place.threads[i] = &t;
    make_runnable(t);
  }
  grid.live += grid.threads;
}

Runnable take_next() {
  auto& all = grid.runnable;
  size_t chosen = random_below(uint32_t(all.size()));
  if (grid.by_priority)
    for (uint32_t k = 1; k < kCandidates; ++k) {
      const size_t other = random_below(uint32_t(all.size()));
      if (all[other].thread && all[chosen].thread &&
          all[other].thread->priority > all[chosen].thread->priority)
        chosen = other;
    }
  const Runnable r = all[chosen];
  all[chosen] = all.back();
  all.pop_back();
  return r;
}

/// Runs threads until one ends, or none can; returns a block whose last one ended.
Block* run_threads() {
  Thread* const first = next_thread();
  if (!first) fail("threads wait for others that never come");
  ended = nullptr;
  enter(*first, *home);
  running = nullptr;
  if (!ended) return nullptr;
  free_threads.push_back(ended);
  --grid.live;
  return --ended->block->live == 0 ? ended->block : nullptr;
}

}  // namespace

void fail(const char* what) {
  fprintf(stderr, "simt: %s", what);
  if (running) fprintf(stderr, " (block %u, thread %u)", running->block->index, running->index);
  fprintf(stderr, "\n");
  describe_waiting();
  _exit(70);
}

void set_seed(uint64_t seed) { generator.state = seed; }

uint32_t random_below(uint32_t end) { return uint32_t((generator() >> 32) * end >> 32); }

int multiprocessors() { return int(1 + random_below(3)); }
int blocks_per_multiprocessor() { return 1; }
uint32_t blocks_together() { return most_together; }
void set_blocks_together(uint32_t blocks) { most_together = blocks; }

void run_grid(uint32_t blocks, uint32_t threads, bool is_cooperative,
              const std::function<void()>& thread) {
  if (threads == 0 || threads > 1024 || blocks == 0) fail("a grid that no device can start");
  static Fiber host;
  home = &host;
  grid = {};
  grid.blocks = blocks;
  grid.threads = threads;
  grid.thread = &thread;
  grid.is_cooperative = is_cooperative;
  grid.by_priority = random_below(2) == 0;
  block_size = {threads, 1, 1};
  grid_size = {blocks, 1, 1};
  uint32_t at_once = std::min(1 + random_below(kMostBlocksAtOnce), kMostThreads / threads);
  at_once = is_cooperative ? blocks : std::max(at_once, 1u);
  while (places.size() < at_once) places.push_back(std::make_unique<Block>());
  std::vector<Block*> free_places;
  for (uint32_t i = 0; i < at_once; ++i) free_places.push_back(places[i].get());
  std::vector<uint32_t> order(blocks);
  for (uint32_t i = 0; i < blocks; ++i) order[i] = i;
  std::shuffle(order.begin(), order.end(), generator);
  while (!order.empty() || grid.live > 0) {
    while (!order.empty() && !free_places.empty()) {
      start_block(*free_places.back(), order.back());
      free_places.pop_back();
      order.pop_back();
    }
    if (Block* const over = run_threads()) free_places.push_back(over);
  }
  for (const auto& place : places) place->threads.clear();
  acquire(&end_tag);
}

void yield() {
  if (!running) return;
  make_runnable(*running);
  stop();
}

void before_atomic(const void* address) {
  if (!running) return;
  running->last_atomic = const_cast<void*>(address);
  yield();
}

void meet_block() {
  if (is_skipped(SiteKind::kBlock, __builtin_return_address(0))) return yield();
  meet_in_block(false, false);
}

uint32_t count_in_block(bool flag) { return meet_in_block(true, flag); }

void meet_grid() {
  if (is_skipped(SiteKind::kGrid, __builtin_return_address(0))) return yield();
  if (!grid.is_cooperative) fail("a grid waits for itself, but its launch is not cooperative");
  meet(grid.meeting, grid.blocks * grid.threads, false, "its grid", [](const auto& wake) {
    for (const auto& place : places)
      for (Thread* t : place->threads) wake(*t);
  });
}

uint64_t meet_warp(WarpOp op, uint32_t mask, uint64_t value, uint32_t from) {
  if (op == WarpOp::kSync && is_skipped(SiteKind::kWarp, __builtin_return_address(0))) {
    yield();
    return 0;
  }
  Warp& warp = warp_of(*running);
  const uint32_t self = running->index % kWarpLanes;
  if (!(mask >> self & 1)) fail("a lane is not in its own mask");
  const auto first = static_cast<uint32_t>(std::countr_zero(mask));
  warp.lanes[self] = {op, mask, from, value, 0};
  char* tag = &warp.tags[first][warp.phases[first]];
  if (op == WarpOp::kSync) release(tag);
  warp.waiting |= 1u << self;
  if (!are_all_here(warp, self)) {
    wait_for("its warp");
  } else {
    give_results(warp, op, mask);
    warp.waiting &= ~mask;
    Thread** threads = &running->block->threads[running->index - self];
    for (uint32_t lanes = mask; lanes != 0; lanes &= lanes - 1)
      make_runnable(*threads[std::countr_zero(lanes)]);
    if (op == WarpOp::kSync) warp.phases[first] ^= 1;
    stop();
  }
  if (op == WarpOp::kSync) acquire(tag);
  return warp.lanes[self].result;
}

uint32_t gather_lanes() {
  const void* place = __builtin_return_address(0);
  Warp& warp = warp_of(*running);
  const uint32_t lane = running->index % kWarpLanes;
  Gathering* mine = nullptr;
  for (const auto& g : warp.gatherings)
    if (g->place == place) mine = g.get();
  if (!mine) {
    warp.gatherings.push_back(std::make_unique<Gathering>());
    mine = warp.gatherings.back().get();
    *mine = {running->index / kWarpLanes, 0, place};
    grid.runnable.push_back({nullptr, mine, running->block});
  }
  mine->lanes |= 1u << lane;
  wait_for("lanes that gather");
  return uint32_t(warp.lanes[lane].result);
}

void acquire_last() {
  if (is_skipped(SiteKind::kFence, __builtin_return_address(0))) return yield();
  if (running && running->last_atomic) acquire(running->last_atomic);
  yield();
}

bool releases(const void* counter) {
  before_atomic(counter);
  return !is_skipped(SiteKind::kRelease, __builtin_return_address(0));
}

void* shared_memory(const void* array, size_t bytes) {
  Block& block = *running->block;
  acquire(&block.end_tag);
  const auto [at, is_new] = block.arrays.try_emplace(array, block.used);
  if (is_new) {
    block.used += (bytes + 15) / 16 * 16;
    if (block.used > kMostShared) fail("a block has more shared memory than CUDA allows");
  }
  return block.memory.get() + at->second;
}

}  // namespace umbel::simt
