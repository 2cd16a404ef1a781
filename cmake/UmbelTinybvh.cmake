# Finds tiny_bvh.h for ray_bench, which compares with it: sets UMBEL_TINYBVH_DIR, or leaves it
# empty. Fetched with cargo only where UMBEL_BENCH_TINYBVH asks for it.

option(UMBEL_BENCH_TINYBVH "Compare with tinybvh in ray_bench (fetches a crate with cargo)" OFF)
set(UMBEL_TINYBVH_DIR "" CACHE PATH "The folder of tiny_bvh.h")
mark_as_advanced(UMBEL_TINYBVH_DIR)

function(umbel_tinybvh_from_cargo)
  find_program(UMBEL_CARGO cargo)
  mark_as_advanced(UMBEL_CARGO)
  if(NOT UMBEL_CARGO)
    message(STATUS "tinybvh: no cargo here to fetch the crate with")
    return()
  endif()
  # A copy, because cargo writes a Cargo.lock beside the manifest.
  set(manifest_folder ${PROJECT_BINARY_DIR}/tinybvh-crate)
  file(COPY ${PROJECT_SOURCE_DIR}/cmake/tinybvh/ DESTINATION ${manifest_folder})
  execute_process(
    COMMAND ${UMBEL_CARGO} metadata --format-version 1 --manifest-path
            ${manifest_folder}/Cargo.toml
    OUTPUT_VARIABLE answer ERROR_VARIABLE error RESULT_VARIABLE status)
  if(NOT status EQUAL 0)
    string(STRIP "${error}" error)
    message(STATUS "tinybvh: cargo could not fetch the crate: ${error}")
    return()
  endif()
  string(JSON count LENGTH "${answer}" packages)
  math(EXPR last "${count} - 1")
  foreach(i RANGE ${last})
    string(JSON name GET "${answer}" packages ${i} name)
    if(name STREQUAL "tinybvh-rs")
      string(JSON manifest GET "${answer}" packages ${i} manifest_path)
      file(TO_CMAKE_PATH "${manifest}" manifest)
      get_filename_component(folder "${manifest}" DIRECTORY)
      set(UMBEL_TINYBVH_DIR "${folder}/ffi/tinybvh" CACHE PATH "" FORCE)
      return()
    endif()
  endforeach()
endfunction()

if(UMBEL_BENCH_TINYBVH AND NOT UMBEL_TINYBVH_DIR)
  umbel_tinybvh_from_cargo()
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
