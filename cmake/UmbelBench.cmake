# The programs in bench/: each bench/NAME.cpp is the program bench/NAME of the build folder.

file(GLOB umbel_bench_sources CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/bench/*.cpp)
foreach(source ${umbel_bench_sources})
  get_filename_component(name ${source} NAME_WE)
  add_executable(${name} ${source})
  umbel_compile_options(${name})
  set_target_properties(${name} PROPERTIES RUNTIME_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/bench)
  target_include_directories(${name} PRIVATE ${PROJECT_SOURCE_DIR}/src)
  target_link_libraries(${name} PRIVATE umbel_internal umbel_meshoptimizer_library TBB::tbb)
  if(UMBEL_CLUSTERLOD_DIR)
    target_include_directories(${name} SYSTEM PRIVATE ${UMBEL_CLUSTERLOD_DIR})
    target_compile_definitions(${name} PRIVATE UMBEL_HAS_CLUSTERLOD)
  endif()
endforeach()

# Counts loads and stores by the calls that -fsanitize=thread puts into code: bench/device_memory
# has these functions, and nothing is sanitized. Counts are of code at -O1, which keeps loads as they
# are written.
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  target_sources(device_counts PRIVATE ${PROJECT_SOURCE_DIR}/bench/device_memory/calls.cpp)
  set_source_files_properties(${PROJECT_SOURCE_DIR}/bench/device_counts.cpp
                              PROPERTIES COMPILE_OPTIONS "-O1;-fsanitize=thread;-Wno-tsan")
else()
  set_target_properties(device_counts PROPERTIES EXCLUDE_FROM_ALL ON)
endif()

include(UmbelTinybvh)
include(UmbelUfbx)
