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

include(UmbelTinybvh)
include(UmbelUfbx)
