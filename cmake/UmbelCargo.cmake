# umbel_crate_folder(<what> <crate> <variable>): the folder of a Rust crate's sources, which cargo
# downloads if need be, or nothing (and a line that says why). cmake/<what>/Cargo.toml asks for
# the crate.
function(umbel_crate_folder what crate variable)
  set(${variable} "" PARENT_SCOPE)
  find_program(UMBEL_CARGO cargo)
  mark_as_advanced(UMBEL_CARGO)
  if(NOT UMBEL_CARGO)
    message(STATUS "${what}: no cargo here to fetch the crate with")
    return()
  endif()
  # A copy of the manifest, because cargo writes a Cargo.lock beside it.
  set(manifest_folder ${PROJECT_BINARY_DIR}/${what}-crate)
  file(COPY ${PROJECT_SOURCE_DIR}/cmake/${what}/ DESTINATION ${manifest_folder})
  set(ask ${UMBEL_CARGO} metadata --format-version 1 --manifest-path ${manifest_folder}/Cargo.toml)
  execute_process(
    COMMAND ${ask} --offline
    OUTPUT_VARIABLE answer ERROR_QUIET RESULT_VARIABLE status)
  if(NOT status EQUAL 0)
    message(STATUS "${what}: fetching the crate with cargo")
    execute_process(
      COMMAND ${ask}
      OUTPUT_VARIABLE answer ERROR_VARIABLE error RESULT_VARIABLE status)
  endif()
  if(NOT status EQUAL 0)
    string(STRIP "${error}" error)
    message(STATUS "${what}: cargo could not fetch the crate: ${error}")
    return()
  endif()
  string(JSON count LENGTH "${answer}" packages)
  math(EXPR last "${count} - 1")
  foreach(i RANGE ${last})
    string(JSON name GET "${answer}" packages ${i} name)
    if(name STREQUAL crate)
      string(JSON manifest GET "${answer}" packages ${i} manifest_path)
      file(TO_CMAKE_PATH "${manifest}" manifest)
      get_filename_component(folder "${manifest}" DIRECTORY)
      set(${variable} "${folder}" PARENT_SCOPE)
      return()
    endif()
  endforeach()
  message(STATUS "${what}: cargo's answer names no crate `${crate}`")
endfunction()

# umbel_bench_crate(<what> <crate> <folder> <target> <option>...): lets the benchmark <target> compare
# with <what>, whose C or C++ sources are in <folder> of a crate. UMBEL_<WHAT>_DIR names the sources'
# folder; cargo fetches them only if UMBEL_BENCH_<WHAT> asks for it. The benchmark compiles their
# implementation, so with the compiler's <option>s and without its warnings.
function(umbel_bench_crate what crate folder target)
  string(TOUPPER ${what} name)
  option(UMBEL_BENCH_${name} "Compare with ${what} in ${target} (fetches a crate with cargo)" OFF)
  set(UMBEL_${name}_DIR "" CACHE PATH "The folder of ${what}'s sources")
  mark_as_advanced(UMBEL_${name}_DIR)
  if(UMBEL_BENCH_${name} AND NOT UMBEL_${name}_DIR)
    umbel_crate_folder(${what} ${crate} crate_folder)
    if(crate_folder)
      set(UMBEL_${name}_DIR "${crate_folder}/${folder}" CACHE PATH "" FORCE)
    endif()
  endif()
  if(UMBEL_${name}_DIR AND TARGET ${target})
    message(STATUS "${what}: ${UMBEL_${name}_DIR}")
    target_include_directories(${target} SYSTEM PRIVATE ${UMBEL_${name}_DIR})
    target_compile_definitions(${target} PRIVATE UMBEL_HAS_${name})
    target_compile_options(${target} PRIVATE ${ARGN} -w)
  endif()
endfunction()
