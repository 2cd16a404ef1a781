// An executor that runs on one thread and counts what cuda_exec.cuh would start, and what its
// kernels do to memory. Primitives of CUB count as what their usual ways do: a reduction reads its
// input once; a scan as well, and writes its output; a sort by radix reads the keys once, and then
// reads and writes all in every pass of 8 bits.
#pragma once

#include "base/exec.hpp"
#include "counts.hpp"

namespace bench {

class CountingExec : public umbel::CpuExec {
 public:
  uint32_t waits = 0;

  /// What was done since the last call.
  KernelCounts take(const std::string& stage) {
    KernelCounts taken = std::exchange(counts_, {});
    taken.stage = stage;
    return taken;
  }

  template <typename T>
  T read(const T* value) {
    ++waits;
    return *value;
  }
  template <typename Body>
  void for_each(size_t n, const Body& body, size_t /*grain*/ = 1) {
    if (n == 0) return;
    begin_kernel();
    run(n, body);
    end();
  }
  template <typename Body>
  void for_each_of(const uint32_t* count, uint32_t most, uint32_t each, const Body& body) {
    begin_kernel();
    run(size_t(each) * std::min(*count, most), body);
    end();
  }
  template <typename Body>
  void for_each_layer(const uint32_t* counts, uint32_t layers, uint32_t most, uint32_t each,
                      const Body& body) {
    begin_kernel();
    for (uint32_t layer = 0; layer < layers && counts[layer] > 0; ++layer)
      run(size_t(each) * std::min(counts[layer], most), [&](size_t i) { body(layer, i); });
    end();
  }
  template <typename Body>
  void for_each_layer_team(const uint32_t* counts, uint32_t layers, uint32_t most,
                           const Body& body) {
    begin_kernel();
    for (uint32_t layer = 0; layer < layers && counts[layer] > 0; ++layer)
      run_teams<typename Body::Shared>(std::min(counts[layer], most),
                                       [&](const umbel::SerialTeam& team, size_t i, auto& shared) {
                                         body(team, layer, i, shared);
                                       });
    end();
  }
  template <typename Body>
  void for_each_team(size_t n, const Body& body) {
    if (n == 0) return;
    begin_kernel();
    run_teams<typename Body::Shared>(n, body);
    end();
  }
  template <typename Body>
  void for_each_team_of(const uint32_t* count, uint32_t most, const Body& body) {
    begin_kernel();
    run_teams<typename Body::Shared>(std::min(*count, most), body);
    end();
  }
  template <typename T, typename Map, typename Op>
  void reduce(size_t n, T init, const Map& map, const Op& op, T* result) {
    begin_kernel(2);
    T value = init;
    run(n, [&](size_t i) { value = op(value, map(i)); });
    *result = value;
    end();
  }
  template <typename T, typename In>
  void exclusive_scan(size_t n, const In& in, T* out) {
    begin_kernel(2);
    T sum = 0;
    run(n, [&](size_t i) {
      const T value = in(i);
      out[i] = sum;
      sum += value;
    });
    out[n] = sum;
    end();
  }
  template <typename Keep>
  void select(size_t n, const Keep& keep, uint32_t* out, uint32_t* count) {
    begin_kernel(2);
    uint32_t kept = 0;
    run(n, [&](size_t i) {
      if (keep(i)) out[kept++] = static_cast<uint32_t>(i);
    });
    *count = kept;
    end();
  }
  template <typename Key>
  void run_length(size_t n, const Key* keys, uint32_t* starts, uint32_t* runs) {
    select(n, [=](size_t i) { return i == 0 || keys[i] != keys[i - 1]; }, starts, runs);
    for_each(1, [=](size_t) { starts[*runs] = static_cast<uint32_t>(n); });
  }
  template <typename Key>
  void radix_sort_pairs(size_t n, Key* keys, uint32_t* values, uint32_t first_bit,
                        uint32_t last_bit) {
    if (n < 2 || last_bit <= first_bit) return;
    const uint64_t passes = (last_bit - first_bit + 7) / 8, copies = passes % 2 == 0 ? 0 : 1;
    CpuExec::radix_sort_pairs(n, keys, values, first_bit, last_bit);
    begin_kernel(2 + passes + 2 * copies);
    const uint64_t pairs = n * (sizeof(Key) + 4);
    count_arrays(n * sizeof(Key) + (passes + copies) * pairs, (passes + copies) * pairs);
    end();
  }

 private:
  void end() { counts_.add(end_kernel()); }
  template <typename Body>
  void run(size_t n, const Body& body) {
    for (size_t i = 0; i < n; ++i) {
      begin_thread();
      body(i);
    }
  }
  /// A team's lanes are one thread here, and no chain.
  template <typename Shared, typename Body>
  void run_teams(size_t n, const Body& body) {
    const umbel::CpuBuffer<Shared> shared(1);
    pass_over(shared.data(), sizeof(Shared));
    for (size_t i = 0; i < n; ++i) {
      begin_thread();
      body(umbel::SerialTeam{}, i, *shared.data());
    }
  }

  KernelCounts counts_;
};

}  // namespace bench
