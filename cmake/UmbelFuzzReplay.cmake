# All fuzzers of tests/fuzz in one program, with any compiler: it runs the inputs that are kept in
# tests/fuzz/corpus and some mutations of them. One test a fuzzer.

file(GLOB umbel_fuzz_sources CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/tests/fuzz/*.cpp)
add_executable(umbel_fuzz_replay ${PROJECT_SOURCE_DIR}/tests/fuzz/replay/fuzz_replay.cpp)
set(umbel_fuzzers "")
foreach(source ${umbel_fuzz_sources})
  get_filename_component(name ${source} NAME_WE)
  string(APPEND umbel_fuzzers "UMBEL_FUZZER(${name})\n")
  target_sources(umbel_fuzz_replay PRIVATE ${source})
  set_source_files_properties(
    ${source} PROPERTIES COMPILE_DEFINITIONS
                         "LLVMFuzzerTestOneInput=${name}_input;LLVMFuzzerInitialize=${name}_initialize")
  add_test(NAME fuzz.${name} COMMAND umbel_fuzz_replay --seconds 1 ${name}
           WORKING_DIRECTORY ${PROJECT_SOURCE_DIR})
  set_tests_properties(fuzz.${name} PROPERTIES TIMEOUT 600)
endforeach()
file(CONFIGURE OUTPUT ${PROJECT_BINARY_DIR}/fuzz/fuzzers.inc CONTENT "${umbel_fuzzers}" @ONLY)
umbel_compile_options(umbel_fuzz_replay)
target_include_directories(umbel_fuzz_replay PRIVATE ${PROJECT_SOURCE_DIR}/src
                                                     ${PROJECT_SOURCE_DIR}/tests/fuzz
                                                     ${PROJECT_BINARY_DIR}/fuzz)
target_sources(umbel_fuzz_replay PRIVATE $<TARGET_OBJECTS:umbel_cuda_on_processor_objects>)
target_link_libraries(umbel_fuzz_replay PRIVATE umbel_internal TBB::tbb)
