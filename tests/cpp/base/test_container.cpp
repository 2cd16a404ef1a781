#include <gtest/gtest.h>

#include <cstdint>
#include <vector>

#include "asset/scratch.hpp"
#include "base/container.hpp"
#include "base/container_faults.hpp"

namespace umbel {
namespace {

using testing::read_bytes;
using testing::Scratch;

constexpr ContainerKind kKind{".test", {'U', 'M', 'T', 'E', 'S', 'T', '\r', '\n'}, 1, 0};

struct Arrays {
  std::vector<uint32_t> first, second, third;
  ContainerFields fields{};
  bool operator==(const Arrays&) const = default;
};

Arrays sample() {
  Arrays arrays{{1, 2, 3}, {}, std::vector<uint32_t>(40, 0xdeadbeef)};
  for (size_t i = 0; i < arrays.fields.size(); ++i) arrays.fields[i] = std::byte(i);
  return arrays;
}

void save(const Arrays& arrays, const std::string& path) {
  write_container(path, kKind, arrays.fields,
                  container_bytes(arrays.first, arrays.second, arrays.third));
}

Arrays load(const std::string& path) {
  return reading(path, [&] {
    const ContainerFile file(path, kKind);
    Arrays arrays;
    arrays.fields = file.fields();
    arrays.first.resize(file.bytes(0) / 4);
    arrays.second.resize(file.bytes(1) / 4);
    arrays.third.resize(file.bytes(2) / 4);
    file.read(container_arrays(arrays.first, arrays.second, arrays.third));
    return arrays;
  });
}

testing::Failure failure_of(const std::filesystem::path& path) {
  try {
    (void)load(path.string());
  } catch (const Error& error) {
    return error.code();
  }
  return {};
}

std::vector<char> saved() {
  const Scratch scratch;
  save(sample(), (scratch / "a").string());
  return read_bytes(scratch / "a");
}

TEST(Container, what_is_loaded_is_what_was_saved) {
  const Scratch scratch;
  for (const Arrays& arrays : {sample(), Arrays{}}) {
    save(arrays, (scratch / "a").string());
    EXPECT_EQ(load((scratch / "a").string()), arrays);
  }
}

TEST(Container, arrays_lie_at_multiples_of_64_bytes_and_the_last_ends_the_file) {
  const std::vector<char> bytes = saved();
  uint64_t end = 192;
  for (size_t entry = 112; entry < 184; entry += 24) {
    const uint64_t offset = testing::get_word(bytes, entry);
    EXPECT_EQ(offset, (end + 63) / 64 * 64);
    end = offset + testing::get_word(bytes, entry + 8);
  }
  EXPECT_EQ(bytes.size(), end);
  EXPECT_EQ(testing::get_word(bytes, 16), end);
}

TEST(Container, changed_bytes_are_noticed) {
  testing::expect_changed_bytes_are_noticed(saved(), failure_of);
}

TEST(Container, other_lengths_are_noticed) {
  testing::expect_other_lengths_are_noticed(saved(), failure_of);
}

TEST(Container, sections_that_lie_elsewhere_are_refused) {
  // The words of the header but for magic, version and fields, under right checksums.
  std::vector<char> bytes = saved();
  for (size_t at = 112; at < 184; at += at % 24 == 0 ? 16 : 8) {
    std::vector<char> moved = bytes;
    testing::put_word(moved, at, 8, testing::get_word(bytes, at) + 64);
    testing::repair_container_checksums(moved);
    const Scratch scratch;
    testing::write_bytes(scratch / "a", moved);
    EXPECT_EQ(failure_of(scratch / "a"), ErrorCode::kCorrupt) << "byte " << at;
  }
}

TEST(Container, other_versions_and_other_files_are_refused) {
  testing::expect_other_files_are_refused(saved(), failure_of);
}

TEST(Container, saving_is_whole_or_nothing) {
  testing::expect_saving_is_whole_or_nothing([](const std::string& path) { save(sample(), path); });
}

TEST(Container, errors_name_the_file) {
  const Scratch scratch;
  testing::write_bytes(scratch / "short", {'a', 'b'});
  try {
    load((scratch / "short").string());
    ADD_FAILURE() << "nothing was thrown";
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find((scratch / "short").string()), std::string::npos);
  }
}

}  // namespace
}  // namespace umbel
