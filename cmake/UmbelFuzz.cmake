# The fuzzers in tests/fuzz/, for libFuzzer: clang only. scripts/fuzz.sh builds the library with
# the sanitizers and runs them.

if(NOT CMAKE_CXX_COMPILER_ID MATCHES "Clang")
  message(FATAL_ERROR "The fuzzers need clang: `make fuzz` brings it and builds them.")
endif()
file(GLOB umbel_fuzz_sources CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/tests/fuzz/*.cpp)
foreach(source ${umbel_fuzz_sources})
  get_filename_component(name ${source} NAME_WE)
  add_executable(${name} ${source})
  umbel_compile_options(${name})
  target_include_directories(${name} PRIVATE ${PROJECT_SOURCE_DIR}/src)
  target_link_libraries(${name} PRIVATE umbel_internal TBB::tbb)
  target_link_options(${name} PRIVATE -fsanitize=fuzzer)
endforeach()

# The C interface for devices, on the processor.
file(GLOB umbel_on_processor_sources CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/tests/on_processor/*.cpp
     ${PROJECT_SOURCE_DIR}/src/capi/cuda/*.cpp)
target_sources(fuzz_cuda_c PRIVATE ${umbel_on_processor_sources})
