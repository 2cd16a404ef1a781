# The C++ tests: one program, umbel_tests.

find_package(GTest QUIET)
if(NOT GTest_FOUND)
  message(FATAL_ERROR "The tests need GoogleTest: install libgtest-dev (Debian, Ubuntu), or leave "
                      "the tests out with -DUMBEL_BUILD_TESTS=OFF.")
endif()
include(GoogleTest)

file(GLOB_RECURSE umbel_test_sources CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/tests/cpp/*.cpp)
if(umbel_test_sources)
  add_executable(umbel_tests ${umbel_test_sources})
  umbel_compile_options(umbel_tests)
  if(NOT MSVC)
    # GCC finds the `else` inside EXPECT_ macros ambiguous wherever one follows a plain `if`.
    target_compile_options(umbel_tests PRIVATE -Wno-dangling-else)
  endif()
  target_include_directories(umbel_tests PRIVATE ${PROJECT_SOURCE_DIR}/src
                                                 ${PROJECT_SOURCE_DIR}/tests/cpp)
  target_link_libraries(umbel_tests PRIVATE umbel_internal umbel_meshoptimizer_library TBB::tbb
                                            GTest::gtest_main)
  # The tests find their meshes from the repository's root. They are listed when ctest runs, not
  # when they are built, because the sanitizers' builds are slow to start.
  gtest_discover_tests(umbel_tests WORKING_DIRECTORY ${PROJECT_SOURCE_DIR}
                       DISCOVERY_MODE PRE_TEST DISCOVERY_TIMEOUT 60 PROPERTIES TIMEOUT 600)
endif()
