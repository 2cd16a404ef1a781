# The C++ tests: one program, umbel_tests.

# UMBEL_GOOGLETEST_DIR names a folder of GoogleTest's sources (holds src/ and include/) to use where
# there is no package.
set(UMBEL_GOOGLETEST_DIR "" CACHE PATH "A folder of GoogleTest's sources (holds src/)")
mark_as_advanced(UMBEL_GOOGLETEST_DIR)
if(UMBEL_GOOGLETEST_DIR)
  add_library(gtest_main STATIC EXCLUDE_FROM_ALL ${UMBEL_GOOGLETEST_DIR}/src/gtest-all.cc
                                                 ${UMBEL_GOOGLETEST_DIR}/src/gtest_main.cc)
  target_compile_features(gtest_main PUBLIC cxx_std_14)
  target_include_directories(gtest_main SYSTEM PUBLIC ${UMBEL_GOOGLETEST_DIR}/include
                             PRIVATE ${UMBEL_GOOGLETEST_DIR})
  find_package(Threads REQUIRED)
  target_link_libraries(gtest_main PUBLIC Threads::Threads)
  add_library(GTest::gtest_main ALIAS gtest_main)
  set(GTest_FOUND ON)
else()
  find_package(GTest QUIET)
endif()
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
    # The library is as it is shipped; the tests themselves need no more than -O1.
    target_compile_options(umbel_tests PRIVATE $<$<CONFIG:Release>:-O1>)
  endif()
  umbel_precompile_headers(umbel_tests <gtest/gtest.h> <filesystem> <fstream> <functional> <random>
                           <thread> <unordered_map>)
  target_include_directories(umbel_tests PRIVATE ${PROJECT_SOURCE_DIR}/src
                                                 ${PROJECT_SOURCE_DIR}/tests/cpp)
  target_link_libraries(umbel_tests PRIVATE umbel_internal umbel_meshoptimizer_library TBB::tbb
                                            GTest::gtest_main)
  if(UMBEL_CLUSTERLOD_DIR)
    target_include_directories(umbel_tests SYSTEM PRIVATE ${UMBEL_CLUSTERLOD_DIR})
    target_compile_definitions(umbel_tests PRIVATE UMBEL_HAS_CLUSTERLOD)
  endif()
  # The tests find their meshes from the repository's root. They are listed when ctest runs, not
  # when they are built, because the sanitizers' builds are slow to start.
  gtest_discover_tests(umbel_tests WORKING_DIRECTORY ${PROJECT_SOURCE_DIR}
                       DISCOVERY_MODE PRE_TEST DISCOVERY_TIMEOUT 60 PROPERTIES TIMEOUT 600)
endif()

# What tests of device code compare with, for a device's and for the emulated one.
file(GLOB umbel_device_tests_sources CONFIGURE_DEPENDS
     ${PROJECT_SOURCE_DIR}/tests/cuda/*_on_processor.cpp)
add_library(umbel_device_tests_on_processor OBJECT EXCLUDE_FROM_ALL ${umbel_device_tests_sources})
umbel_compile_options(umbel_device_tests_on_processor)
target_include_directories(umbel_device_tests_on_processor PRIVATE ${PROJECT_SOURCE_DIR}/src
                                                                   ${PROJECT_SOURCE_DIR}/tests/cpp)
target_link_libraries(umbel_device_tests_on_processor PRIVATE umbel_internal TBB::tbb
                                                              GTest::gtest_main)

# The C interface for devices on the processor, for the tests of what calls it from Python.
file(GLOB umbel_on_processor_sources CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/tests/on_processor/*.cpp
     ${PROJECT_SOURCE_DIR}/src/capi/cuda/*.cpp)
add_library(umbel_cuda_on_processor_objects OBJECT ${umbel_on_processor_sources})
umbel_compile_options(umbel_cuda_on_processor_objects)
target_include_directories(umbel_cuda_on_processor_objects PRIVATE ${PROJECT_SOURCE_DIR}/src)
target_link_libraries(umbel_cuda_on_processor_objects PRIVATE umbel_internal TBB::tbb)
add_library(umbel_cuda_on_processor SHARED $<TARGET_OBJECTS:umbel_cuda_on_processor_objects>)
umbel_compile_options(umbel_cuda_on_processor)
target_link_libraries(umbel_cuda_on_processor PRIVATE umbel_internal TBB::tbb)
