// Teams of real threads on the processor, with the code that a device's teams run: what the lanes
// share, their barriers and their atomic operations can be tested without a device.
#pragma once

#include <atomic>
#include <barrier>
#include <cstring>
#include <thread>
#include <vector>

#include "base/exec.hpp"

namespace umbel {

class ThreadTeam {
 public:
  static constexpr bool kIsSerial = false;
  static constexpr uint32_t kLanes = 3;

  struct Meeting {
    std::barrier<> barrier{ptrdiff_t(kLanes)};
    alignas(64) unsigned char values[kLanes][64];
    bool flags[kLanes];
  };
  ThreadTeam(Meeting& meeting, uint32_t rank) : meeting_(&meeting), rank_(rank) {}

  static uint32_t size() { return kLanes; }
  uint32_t rank() const { return rank_; }
  void sync() const { meeting_->barrier.arrive_and_wait(); }

  template <typename T, typename Op>
  T reduce(const T& value, const Op& op) const {
    static_assert(sizeof(T) <= 64);
    memcpy(meeting_->values[rank_], &value, sizeof(T));
    sync();
    T result, other;
    memcpy(&result, meeting_->values[0], sizeof(T));
    for (uint32_t k = 1; k < kLanes; ++k) {
      memcpy(&other, meeting_->values[k], sizeof(T));
      result = op(result, other);
    }
    sync();
    return result;
  }
  uint32_t rank_among(bool flag) const { return count_of(flag, rank_); }
  uint32_t count(bool flag) const { return count_of(flag, kLanes); }
  uint32_t ballot(bool flag) const {
    meeting_->flags[rank_] = flag;
    sync();
    uint32_t bits = 0;
    for (uint32_t k = 0; k < kLanes; ++k) bits |= uint32_t{meeting_->flags[k]} << k;
    sync();
    return bits;
  }

  static uint32_t add(uint32_t* counter, uint32_t amount) {
    return std::atomic_ref<uint32_t>(*counter).fetch_add(amount, std::memory_order_relaxed);
  }
  template <typename T>
  static void lower(T* least, T value) {
    std::atomic_ref<T> shared(*least);
    T seen = shared.load(std::memory_order_relaxed);
    while (value < seen && !shared.compare_exchange_weak(seen, value, std::memory_order_relaxed)) {
    }
  }
  static uint32_t claim(uint32_t* word, uint32_t free, uint32_t value) {
    std::atomic_ref<uint32_t>(*word).compare_exchange_strong(free, value,
                                                             std::memory_order_relaxed);
    return free;
  }

 private:
  uint32_t count_of(bool flag, uint32_t lanes) const {
    meeting_->flags[rank_] = flag;
    sync();
    uint32_t result = 0;
    for (uint32_t k = 0; k < lanes; ++k) result += meeting_->flags[k];
    sync();
    return result;
  }

  Meeting* meeting_;
  uint32_t rank_;
};

/// The processor's executor, but for its teams.
class ThreadTeamExec : public CpuExec {
 public:
  static constexpr bool kSerialTeams = false;

  template <typename Body>
  void for_each_team(size_t n, const Body& body) {
    ThreadTeam::Meeting meeting;
    const CpuBuffer<typename Body::Shared> shared(1);
    std::vector<std::thread> lanes;
    for (uint32_t rank = 0; rank < ThreadTeam::kLanes; ++rank)
      lanes.emplace_back([&, rank] {
        const ThreadTeam team(meeting, rank);
        for (size_t i = 0; i < n; ++i) {
          body(team, i, *shared.data());
          team.sync();
        }
      });
    for (std::thread& lane : lanes) lane.join();
  }
  template <typename Body>
  void for_each_team_of(const uint32_t* count, uint32_t most, const Body& body) {
    for_each_team(std::min(*count, most), body);
  }
};

}  // namespace umbel
