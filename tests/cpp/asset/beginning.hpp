// Files too large for a test, of which only the first bytes are there.
#pragma once

#include <gtest/gtest.h>

#include <cstring>
#include <span>
#include <vector>

#include "umbel/asset.hpp"

namespace umbel::testing {

/// Nothing but the beginning may be read; counts how much of it was.
class Beginning : public ByteSource {
 public:
  Beginning(std::span<const std::byte> bytes, uint64_t size)
      : bytes_(bytes.begin(), bytes.end()), size_(size) {}
  uint64_t size() const override { return size_; }
  void read(uint64_t offset, std::span<std::byte> out) const override {
    ASSERT_LE(offset + out.size(), bytes_.size());
    std::memcpy(out.data(), &bytes_[offset], out.size());
    touched += out.size();
  }
  mutable uint64_t touched = 0;

 private:
  std::vector<std::byte> bytes_;
  uint64_t size_;
};

}  // namespace umbel::testing
