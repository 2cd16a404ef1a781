# Finds tiny_bvh.h for ray_bench, which compares with it: sets UMBEL_TINYBVH_DIR, or leaves it
# empty. Fetched with cargo only where UMBEL_BENCH_TINYBVH asks for it.

include(UmbelCargo)

option(UMBEL_BENCH_TINYBVH "Compare with tinybvh in ray_bench (fetches a crate with cargo)" OFF)
set(UMBEL_TINYBVH_DIR "" CACHE PATH "The folder of tiny_bvh.h")
mark_as_advanced(UMBEL_TINYBVH_DIR)

if(UMBEL_BENCH_TINYBVH AND NOT UMBEL_TINYBVH_DIR)
  umbel_crate_folder(tinybvh tinybvh-rs folder)
  if(folder)
    set(UMBEL_TINYBVH_DIR "${folder}/ffi/tinybvh" CACHE PATH "" FORCE)
  endif()
endif()
if(UMBEL_TINYBVH_DIR AND TARGET ray_bench)
  message(STATUS "tinybvh: ${UMBEL_TINYBVH_DIR}")
  target_include_directories(ray_bench SYSTEM PRIVATE ${UMBEL_TINYBVH_DIR})
  target_compile_definitions(ray_bench PRIVATE UMBEL_HAS_TINYBVH)
  # It needs AVX2, and its implementation is compiled into the benchmark.
  target_compile_options(ray_bench PRIVATE -march=native -w)
endif()
if(TARGET ray_bench)
  target_link_libraries(ray_bench PRIVATE ${CMAKE_DL_LIBS})
endif()
