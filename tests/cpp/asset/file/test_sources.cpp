#include <gtest/gtest.h>

#include <cstring>

#include "asset/same_geometry.hpp"
#include "asset/scratch.hpp"
#include "umbel/asset.hpp"

namespace umbel {
namespace {

using testing::Scratch;

/// Another source, and what was read of it.
class Counting : public ByteSource {
 public:
  explicit Counting(std::shared_ptr<const ByteSource> source) : source_(std::move(source)) {}
  uint64_t size() const override { return source_->size(); }
  void read(uint64_t offset, std::span<std::byte> out) const override {
    if (fails) throw Error(ErrorCode::kIo, "the line is dead");
    ASSERT_LE(offset + out.size(), size());
    bytes += out.size();
    source_->read(offset, out);
  }
  mutable uint64_t bytes = 0;
  bool fails = false;

 private:
  std::shared_ptr<const ByteSource> source_;
};

std::vector<std::byte> bytes_of(const std::filesystem::path& path) {
  const std::vector<char> chars = testing::read_bytes(path);
  std::vector<std::byte> bytes(chars.size());
  std::memcpy(bytes.data(), chars.data(), chars.size());
  return bytes;
}

TEST(ByteSource, of_every_kind_gives_the_same_asset) {
  const Scratch scratch;
  const lod::Dag dag = lod::build(shapes::blob(4, 1).view());
  write_asset(scratch / "a.umbel", dag);
  const std::shared_ptr<const ByteSource> sources[] = {open_file(scratch / "a.umbel"),
                                                       map_file(scratch / "a.umbel"),
                                                       from_memory(bytes_of(scratch / "a.umbel"))};
  for (const auto& source : sources) {
    const Asset asset(source);
    EXPECT_EQ(asset.tables().groups, dag.tables.groups);
    for (uint32_t c = 0; c < dag.tables.clusters.size(); ++c)
      EXPECT_TRUE(testing::triangles_of(asset.geometry(c)) ==
                  testing::triangles_of(dag.geometry(c)));
    EXPECT_TRUE(verify_asset(asset, 4).ok);
  }
}

TEST(ByteSource, is_hardly_read_when_an_asset_is_opened) {
  const Scratch scratch;
  AssetConfig config;
  config.page_bytes = 16384;
  const uint64_t bytes =
      write_asset(scratch / "a.umbel", lod::build(shapes::blob(7, 1).view()), "{}", {}, config);
  const auto counting = std::make_shared<const Counting>(open_file(scratch / "a.umbel"));
  const Asset asset(counting);
  EXPECT_EQ(counting->bytes, asset.info().header_bytes);
  EXPECT_LT(counting->bytes, bytes / 100);
  EXPECT_LT(double(counting->bytes), 8192 + 24.0 * asset.info().pages);
}

TEST(ByteSource, that_fails_is_an_error_and_then_forgotten) {
  const Scratch scratch;
  write_asset(scratch / "a.umbel", lod::build(shapes::sphere(2).view()));
  const auto counting = std::make_shared<Counting>(open_file(scratch / "a.umbel"));
  counting->fails = true;
  EXPECT_THROW(Asset{counting}, Error);
  counting->fails = false;
  const Asset asset(counting);
  counting->fails = true;
  EXPECT_THROW(asset.tables(), Error);
  EXPECT_THROW(asset.read_page(0), Error);
  counting->fails = false;
  EXPECT_FALSE(asset.tables().groups.empty());
}

TEST(ByteSource, has_its_mistakes_named) {
  const Scratch scratch;
  EXPECT_THROW(open_file(scratch / "missing"), Error);
  EXPECT_THROW(map_file(scratch / "missing"), Error);
  EXPECT_THROW(Asset(std::shared_ptr<const ByteSource>()), Error);
  EXPECT_THROW(Asset(from_memory({})), Error);
  testing::write_bytes(scratch / "empty", {});
  EXPECT_THROW(Asset(map_file(scratch / "empty")), Error);
}

}  // namespace
}  // namespace umbel
