// What the file of every structure must stand. INSTANTIATE_TYPED_TEST_SUITE_P runs it on a type
// that names the Structure and has kinds(), some configs, and ask(structure), which asks
// everything.
#pragma once

#include <gtest/gtest.h>

#include "base/container_faults.hpp"
#include "umbel/mesh.hpp"

namespace umbel::testing {

template <typename Files>
std::vector<char> bytes_of(const Mesh& mesh,
                           const typename decltype(Files::kinds())::value_type& config = {}) {
  const Scratch scratch;
  Files::Structure::build(mesh.view(), config).save((scratch / "a").string());
  return read_bytes(scratch / "a");
}

/// What reading a file and asking everything ends with.
template <typename Files>
Failure failure_of(const std::filesystem::path& path) {
  try {
    typename Files::Structure loaded = Files::Structure::load(path.string());
    Files::ask(loaded);
  } catch (const Error& error) {
    EXPECT_GT(std::string(error.what()).size(), 10u);
    return error.code();
  }
  return std::nullopt;
}

template <typename Files>
class StructureFile : public ::testing::Test {};
TYPED_TEST_SUITE_P(StructureFile);

TYPED_TEST_P(StructureFile, AnyByteThatIsChangedIsNoticed) {
  for (const auto& config : TypeParam::kinds()) {
    const std::vector<char> whole = bytes_of<TypeParam>(shapes::sphere(0), config);
    ASSERT_LT(whole.size(), 4000u);
    expect_changed_bytes_are_noticed(whole, failure_of<TypeParam>);
  }
}

TYPED_TEST_P(StructureFile, AnyLengthButTheRightOneIsNoticed) {
  for (const auto& config : TypeParam::kinds())
    expect_other_lengths_are_noticed(bytes_of<TypeParam>(shapes::sphere(0), config),
                                     failure_of<TypeParam>);
}

TYPED_TEST_P(StructureFile, WrongWordsUnderRightChecksumsAreErrorsOrHarmless) {
  for (const auto& config : TypeParam::kinds())
    EXPECT_GT(count_wrong_words_refused(bytes_of<TypeParam>(shapes::sphere(1), config),
                                        failure_of<TypeParam>),
              300u);
}

TYPED_TEST_P(StructureFile, RandomChangesUnderRightChecksumsNeverCrash) {
  for (const auto& config : TypeParam::kinds())
    ask_files_with_random_changes(bytes_of<TypeParam>(shapes::blob(2, 1), config),
                                  failure_of<TypeParam>);
}

TYPED_TEST_P(StructureFile, FilesThatAreNoneOrNewerAreRefused) {
  expect_other_files_are_refused(bytes_of<TypeParam>(shapes::sphere(1)), failure_of<TypeParam>);
}

REGISTER_TYPED_TEST_SUITE_P(StructureFile, AnyByteThatIsChangedIsNoticed,
                            AnyLengthButTheRightOneIsNoticed,
                            WrongWordsUnderRightChecksumsAreErrorsOrHarmless,
                            RandomChangesUnderRightChecksumsNeverCrash,
                            FilesThatAreNoneOrNewerAreRefused);

}  // namespace umbel::testing
