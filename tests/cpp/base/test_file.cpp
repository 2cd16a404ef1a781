#include <gtest/gtest.h>

#include <filesystem>
#include <string>
#include <vector>

#include "asset/scratch.hpp"
#include "base/file.hpp"
#include "base/parallel.hpp"
#include "umbel/types.hpp"

namespace umbel {
namespace {

using testing::read_bytes;
using testing::Scratch;
using testing::write_bytes;

std::vector<char> numbered(size_t size) {
  std::vector<char> bytes(size);
  for (size_t i = 0; i < size; ++i) bytes[i] = static_cast<char>(i * 31 + i / 251);
  return bytes;
}

std::span<const std::byte> bytes_of(const std::vector<char>& bytes) {
  return std::as_bytes(std::span(bytes));
}

template <typename Work>
ErrorCode failure_of(const Work& work) {
  try {
    work();
  } catch (const Error& error) {
    return error.code();
  }
  ADD_FAILURE() << "nothing was thrown";
  return ErrorCode::kInvalidArgument;
}

TEST(File, parts_are_read_from_many_threads) {
  const Scratch scratch;
  const std::vector<char> whole = numbered(100'000);
  write_bytes(scratch / "a", whole);
  const InputFile file(scratch / "a");
  ASSERT_EQ(file.size(), whole.size());
  std::vector<char> read(whole.size());
  parallel_chunks(read.size(), 777, [&](size_t begin, size_t end) {
    file.read(begin, std::as_writable_bytes(std::span(read).subspan(begin, end - begin)));
  });
  EXPECT_EQ(read, whole);
}

TEST(File, reading_past_the_end_is_corrupt) {
  const Scratch scratch;
  write_bytes(scratch / "a", numbered(100));
  const InputFile file(scratch / "a");
  std::vector<std::byte> room(10);
  EXPECT_EQ(failure_of([&] { file.read(95, room); }), ErrorCode::kCorrupt);
  file.read(90, room);
  file.read(100, {});
}

TEST(File, a_file_that_becomes_shorter_is_corrupt) {
  const Scratch scratch;
  write_bytes(scratch / "a", numbered(100));
  const InputFile file(scratch / "a");
  std::filesystem::resize_file(scratch / "a", 50);
  std::vector<std::byte> room(100);
  EXPECT_EQ(failure_of([&] { file.read(0, room); }), ErrorCode::kCorrupt);
}

TEST(File, what_is_no_regular_file_is_refused) {
  const Scratch scratch;
  EXPECT_EQ(failure_of([&] { const InputFile file(scratch / "missing"); }), ErrorCode::kIo);
  EXPECT_EQ(failure_of([&] { const InputFile file(scratch / ""); }), ErrorCode::kIo);
  EXPECT_EQ(failure_of([&] { const OutputFile file(scratch / ""); }), ErrorCode::kIo);
  EXPECT_EQ(failure_of([&] { const OutputFile file(scratch / "no_folder" / "a"); }),
            ErrorCode::kIo);
}

TEST(File, a_file_has_its_name_only_once_it_is_whole) {
  const Scratch scratch;
  write_bytes(scratch / "a", numbered(10));
  const std::vector<char> next = numbered(1000);
  {
    OutputFile file(scratch / "a");
    file.write(500, bytes_of(next).subspan(500));
    EXPECT_EQ(read_bytes(scratch / "a"), numbered(10));
    file.write(0, bytes_of(next).first(500));
    file.commit();
  }
  EXPECT_EQ(read_bytes(scratch / "a"), next);
  EXPECT_EQ(scratch.files(), 1u);
}

TEST(File, a_file_gets_its_name_without_being_flushed) {
  const Scratch scratch;
  write_bytes(scratch / "a", numbered(10));
  OutputFile file(scratch / "a");
  file.write(0, bytes_of(numbered(20)));
  file.commit_unflushed();
  EXPECT_EQ(read_bytes(scratch / "a"), numbered(20));
  EXPECT_EQ(scratch.files(), 1u);
}

TEST(File, what_is_not_committed_leaves_nothing) {
  const Scratch scratch;
  write_bytes(scratch / "a", numbered(10));
  {
    OutputFile file(scratch / "a"), other(scratch / "b");
    file.write(0, bytes_of(numbered(100)));
    other.write(0, bytes_of(numbered(100)));
  }
  EXPECT_EQ(read_bytes(scratch / "a"), numbered(10));
  EXPECT_EQ(scratch.files(), 1u);
}

TEST(File, writers_of_one_name_do_not_disturb_each_other) {
  const Scratch scratch;
  OutputFile first(scratch / "a"), second(scratch / "a");
  first.write(0, bytes_of(numbered(100)));
  second.write(0, bytes_of(numbered(200)));
  first.commit();
  EXPECT_EQ(read_bytes(scratch / "a"), numbered(100));
  second.commit();
  EXPECT_EQ(read_bytes(scratch / "a"), numbered(200));
}

TEST(File, a_link_stays_one) {
  const Scratch scratch;
  write_bytes(scratch / "target", numbered(10));
  std::error_code refused;
  std::filesystem::create_symlink(scratch / "target", scratch / "link", refused);
  if (refused) GTEST_SKIP() << "no links here";
  OutputFile file(scratch / "link");
  file.write(0, bytes_of(numbered(50)));
  file.commit();
  EXPECT_TRUE(std::filesystem::is_symlink(scratch / "link"));
  EXPECT_EQ(read_bytes(scratch / "target"), numbered(50));
}

TEST(File, a_link_to_what_is_not_there_stays_one) {
  const Scratch scratch;
  std::error_code refused;
  std::filesystem::create_directory(scratch / "folder");
  std::filesystem::create_symlink("folder/target", scratch / "next", refused);
  std::filesystem::create_symlink("next", scratch / "link", refused);
  std::filesystem::create_symlink("round", scratch / "round", refused);
  if (refused) GTEST_SKIP() << "no links here";
  OutputFile file(scratch / "link");
  file.write(0, bytes_of(numbered(50)));
  file.commit();
  EXPECT_TRUE(std::filesystem::is_symlink(scratch / "link"));
  EXPECT_EQ(read_bytes(scratch / "folder" / "target"), numbered(50));
  OutputFile(scratch / "round").commit();
  EXPECT_TRUE(std::filesystem::is_regular_file(scratch / "round"));
}

TEST(File, names_may_be_as_long_as_the_system_allows) {
  const Scratch scratch;
  const std::string name(255, 'n');
  OutputFile file(scratch / name);
  file.write(0, bytes_of(numbered(5)));
  file.commit();
  EXPECT_EQ(read_bytes(scratch / name), numbered(5));
}

TEST(TemporaryFile, gives_back_what_was_appended_and_leaves_nothing) {
  const Scratch scratch;
  {
    TemporaryFile file(scratch / ".");
    file.append(bytes_of(numbered(100)));
    file.append(bytes_of(numbered(5000)));
    EXPECT_EQ(file.size(), 5100u);
    std::vector<char> read(5000);
    file.read(100, std::as_writable_bytes(std::span(read)));
    EXPECT_EQ(read, numbered(5000));
  }
  EXPECT_EQ(scratch.files(), 0u);
  EXPECT_THROW(TemporaryFile(scratch / "no_such_folder"), Error);
}

}  // namespace
}  // namespace umbel
