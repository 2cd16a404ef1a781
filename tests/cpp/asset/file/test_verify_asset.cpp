#include <gtest/gtest.h>

#include <atomic>

#include "asset/scratch.hpp"
#include "asset/synthetic_dag.hpp"
#include "umbel/asset.hpp"

namespace umbel {
namespace {

using testing::read_bytes;
using testing::Scratch;
using testing::write_bytes;

bool names(const lod::VerifyReport& report, const std::string& words) {
  for (const std::string& problem : report.problems)
    if (problem.find(words) != std::string::npos) return true;
  return false;
}

lod::Dag built() { return lod::build(shapes::blob(5, 3).view()); }

TEST(VerifyAsset, of_a_built_asset_is_ok) {
  const Scratch scratch;
  const lod::Dag dag = built();
  write_asset(scratch / "a.umbel", dag);
  const auto report = verify_asset(scratch / "a.umbel", 16);
  EXPECT_TRUE(report.ok) << (report.problems.empty() ? "" : report.problems.front());
  EXPECT_EQ(report.cuts, 16u);
}

TEST(VerifyAsset, of_an_empty_asset_is_ok) {
  const Scratch scratch;
  write_asset(scratch / "a.umbel", lod::build(Mesh{}.view()));
  const auto report = verify_asset(scratch / "a.umbel", 4);
  EXPECT_TRUE(report.ok) << (report.problems.empty() ? "" : report.problems.front());
}

TEST(VerifyAsset, reports_damaged_pages) {
  const Scratch scratch;
  write_asset(scratch / "a.umbel", built());
  std::vector<char> bytes = read_bytes(scratch / "a.umbel");
  bytes[5000] ^= 4;
  write_bytes(scratch / "a.umbel", bytes);
  const auto report = verify_asset(scratch / "a.umbel", 4);
  EXPECT_FALSE(report.ok);
  EXPECT_EQ(report.checksum_errors, 1u);
  EXPECT_TRUE(names(report, "checksum of page 0"));
}

/// Of a server that fails from the given read on.
class Failing : public ByteSource {
 public:
  Failing(std::shared_ptr<const ByteSource> source, int left)
      : source_(std::move(source)), left_(left) {}
  uint64_t size() const override { return source_->size(); }
  void read(uint64_t offset, std::span<std::byte> out) const override {
    if (left_-- <= 0) throw Error(ErrorCode::kIo, "the server is busy");
    source_->read(offset, out);
  }

 private:
  std::shared_ptr<const ByteSource> source_;
  mutable std::atomic<int> left_;
};

TEST(VerifyAsset, takes_no_failure_to_read_for_damage) {
  const Scratch scratch;
  AssetConfig config;
  config.page_bytes = 4096;
  write_asset(scratch / "a.umbel", built(), "{}", {}, config);
  const auto verify = [&](int reads, bool within) {
    const Asset asset(std::make_shared<Failing>(open_file(scratch / "a.umbel"), reads));
    return within ? verify_asset_within(uint64_t{256} << 20, asset, 2) : verify_asset(asset, 2);
  };
  for (const bool within : {false, true}) {
    int reads = 3;
    for (bool ends = false; !ends; reads += 1 + reads / 4) {
      try {
        EXPECT_TRUE(verify(reads, within).ok) << reads;
        ends = true;
      } catch (const Error& error) {
        ASSERT_EQ(error.code(), ErrorCode::kIo) << error.what();
      }
    }
    EXPECT_GT(reads, 10);
  }
}

TEST(VerifyAsset, reports_what_cannot_be_opened) {
  const Scratch scratch;
  write_asset(scratch / "a.umbel", built());
  const std::vector<char> whole = read_bytes(scratch / "a.umbel");
  std::vector<char> bytes = whole;
  bytes.resize(whole.size() / 2);
  write_bytes(scratch / "short.umbel", bytes);
  EXPECT_TRUE(names(verify_asset(scratch / "short.umbel"), "bytes, but it has"));
  bytes = whole;
  bytes[700] ^= 1;
  write_bytes(scratch / "tables.umbel", bytes);
  EXPECT_TRUE(names(verify_asset(scratch / "tables.umbel"), "checksum of the tables"));
  write_bytes(scratch / "other.umbel", {'p', 'l', 'y'});
  EXPECT_TRUE(names(verify_asset(scratch / "other.umbel"), "not a .umbel file"));
  for (const char* name : {"short.umbel", "tables.umbel", "other.umbel"}) {
    const auto report = verify_asset(scratch / name);
    EXPECT_FALSE(report.ok) << name;
    EXPECT_GE(report.checksum_errors, 1u) << name;
  }
}

TEST(VerifyAsset, throws_for_a_missing_file) {
  const Scratch scratch;
  try {
    verify_asset(scratch / "missing.umbel");
    ADD_FAILURE() << "nothing was thrown";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kIo);
  }
}

}  // namespace
}  // namespace umbel
