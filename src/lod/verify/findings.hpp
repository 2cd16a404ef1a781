// What verification finds: counts, and the first sentences.
#pragma once

#include <string>
#include <utility>

#include "umbel/lod/verify.hpp"

namespace umbel::lod {

/// Nine digits, enough to tell any two floats apart.
std::string text(float value);
std::string text(const Vec3& position);
std::string text(const Sphere& sphere);
std::string number(uint64_t value);

/// Counts every finding and keeps the sentences of the first few of each stage, so that one kind
/// of damage does not hide another. A sentence is a function, called only if it is kept.
class Findings {
 public:
  explicit Findings(VerifyReport& report) : report_(report) {}

  void begin_stage() { in_stage_ = 0; }

  template <typename Sentence>
  void limit(const Sentence& sentence) {
    ++report_.limit_violations;
    keep(sentence);
  }
  template <typename Sentence>
  void not_monotone(const Sentence& sentence) {
    report_.monotone = false;
    keep(sentence);
  }
  template <typename Sentence>
  void crack(const Sentence& sentence, uint64_t count = 1) {
    report_.cracks += count;
    keep(sentence);
  }
  template <typename Sentence>
  void overlap(const Sentence& sentence, uint64_t count = 1) {
    report_.overlaps += count;
    keep(sentence);
  }
  /// A finding that no count stands for.
  template <typename Sentence>
  void other(const Sentence& sentence) {
    keep(sentence);
  }

  /// Adds what was found of a part by itself.
  void absorb(const VerifyReport& part) {
    report_.cracks += part.cracks;
    report_.overlaps += part.overlaps;
    report_.limit_violations += part.limit_violations;
    report_.monotone &= part.monotone;
    report_.ok &= part.ok;
    for (const std::string& problem : part.problems) keep([&] { return problem; });
  }

 private:
  static constexpr size_t kMost = 32, kMostInStage = 8;

  template <typename Sentence>
  void keep(const Sentence& sentence) {
    report_.ok = false;
    if (report_.problems.size() < kMost && in_stage_++ < kMostInStage)
      report_.problems.push_back(sentence());
  }

  VerifyReport& report_;
  size_t in_stage_ = 0;
};

}  // namespace umbel::lod
