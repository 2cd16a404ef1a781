# Finds ufbx.h and ufbx.c for obj_bench, which compares with it: sets UMBEL_UFBX_DIR, or leaves it
# empty. Fetched with cargo only where UMBEL_BENCH_UFBX asks for it.

include(UmbelCargo)

option(UMBEL_BENCH_UFBX "Compare with ufbx in obj_bench (fetches a crate with cargo)" OFF)
set(UMBEL_UFBX_DIR "" CACHE PATH "The folder of ufbx.h and ufbx.c")
mark_as_advanced(UMBEL_UFBX_DIR)

if(UMBEL_BENCH_UFBX AND NOT UMBEL_UFBX_DIR)
  umbel_crate_folder(ufbx ufbx folder)
  if(folder)
    set(UMBEL_UFBX_DIR "${folder}/ufbx" CACHE PATH "" FORCE)
  endif()
endif()
if(UMBEL_UFBX_DIR AND TARGET obj_bench)
  message(STATUS "ufbx: ${UMBEL_UFBX_DIR}")
  target_include_directories(obj_bench SYSTEM PRIVATE ${UMBEL_UFBX_DIR})
  target_compile_definitions(obj_bench PRIVATE UMBEL_HAS_UFBX)
  target_compile_options(obj_bench PRIVATE -w)  # its implementation is compiled into the benchmark
endif()
