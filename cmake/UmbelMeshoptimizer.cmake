# Finds meshoptimizer >= 1.0 and makes the target `umbel_meshoptimizer`: its headers, for Umbel's
# own sources, and where it is built here, its objects too (they become part of libumbel).
#
# UMBEL_MESHOPTIMIZER chooses where it comes from:
#   system   an installed package, by find_package
#   cargo    the Rust crate `meshopt`, which carries the C++ sources (see meshoptimizer/Cargo.toml)
#   github   its public repository, by FetchContent
#   auto     the first of these that works
# UMBEL_MESHOPTIMIZER_DIR names a folder of sources to use instead (the one that holds src/).
#
# Sets UMBEL_CLUSTERLOD_DIR to the folder of clusterlod.h, where there is one.

include(UmbelCargo)

set(umbel_meshoptimizer_version 1.0)
set(umbel_meshoptimizer_tag v1.2)
set(UMBEL_MESHOPTIMIZER auto CACHE STRING "Where meshoptimizer comes from: auto, system, cargo, github")
set_property(CACHE UMBEL_MESHOPTIMIZER PROPERTY STRINGS auto system cargo github)
set(UMBEL_MESHOPTIMIZER_DIR "" CACHE PATH "A folder of meshoptimizer's sources (holds src/)")
mark_as_advanced(UMBEL_MESHOPTIMIZER_DIR)

# Each step below sets umbel_meshoptimizer_found, or says why not.

macro(umbel_meshoptimizer_from_system)
  # Its version file accepts the exact version only, so the version is compared here.
  find_package(meshoptimizer QUIET CONFIG)
  if(NOT meshoptimizer_FOUND)
    message(STATUS "meshoptimizer: no installed package")
  elseif(meshoptimizer_VERSION VERSION_LESS umbel_meshoptimizer_version)
    message(STATUS "meshoptimizer: the installed package is ${meshoptimizer_VERSION}, "
                   "older than ${umbel_meshoptimizer_version}: not used")
  else()
    set(umbel_meshoptimizer_found package)
    message(STATUS "meshoptimizer ${meshoptimizer_VERSION}: ${meshoptimizer_DIR}")
  endif()
endmacro()

function(umbel_meshoptimizer_from_cargo)
  umbel_crate_folder(meshoptimizer meshopt folder)
  if(folder)
    set(umbel_meshoptimizer_found "${folder}/vendor" PARENT_SCOPE)
  endif()
endfunction()

function(umbel_meshoptimizer_from_github)
  include(FetchContent)
  message(STATUS "meshoptimizer: fetching ${umbel_meshoptimizer_tag} from its repository "
                 "(if that fails: install cargo, or set UMBEL_MESHOPTIMIZER_DIR)")
  FetchContent_Declare(
    umbel_meshoptimizer_sources
    GIT_REPOSITORY https://github.com/zeux/meshoptimizer.git
    GIT_TAG ${umbel_meshoptimizer_tag}
    GIT_SHALLOW ON
    SOURCE_SUBDIR no-build-file-here)
  FetchContent_MakeAvailable(umbel_meshoptimizer_sources)
  set(umbel_meshoptimizer_found "${umbel_meshoptimizer_sources_SOURCE_DIR}" PARENT_SCOPE)
endfunction()

set(umbel_meshoptimizer_found "")
if(UMBEL_MESHOPTIMIZER_DIR)
  set(umbel_meshoptimizer_found "${UMBEL_MESHOPTIMIZER_DIR}")
else()
  if(UMBEL_MESHOPTIMIZER MATCHES "^(auto|system)$")
    umbel_meshoptimizer_from_system()
  endif()
  if(NOT umbel_meshoptimizer_found AND UMBEL_MESHOPTIMIZER MATCHES "^(auto|cargo)$")
    umbel_meshoptimizer_from_cargo()
  endif()
  if(NOT umbel_meshoptimizer_found AND UMBEL_MESHOPTIMIZER MATCHES "^(auto|github)$")
    umbel_meshoptimizer_from_github()
  endif()
endif()
if(NOT umbel_meshoptimizer_found)
  message(
    FATAL_ERROR
      "Umbel needs meshoptimizer >= ${umbel_meshoptimizer_version}: install it, or cargo, "
      "or give a folder of its sources as UMBEL_MESHOPTIMIZER_DIR.")
endif()

if(umbel_meshoptimizer_found STREQUAL "package")
  add_library(umbel_meshoptimizer INTERFACE)
  target_link_libraries(umbel_meshoptimizer INTERFACE meshoptimizer::meshoptimizer)
  add_library(umbel_meshoptimizer_library ALIAS umbel_meshoptimizer)
  set(umbel_meshoptimizer_is_package ON)
else()
  file(GLOB umbel_meshoptimizer_files ${umbel_meshoptimizer_found}/src/*.cpp)
  if(NOT umbel_meshoptimizer_files)
    message(FATAL_ERROR "meshoptimizer: there are no sources in ${umbel_meshoptimizer_found}/src")
  endif()
  file(STRINGS ${umbel_meshoptimizer_found}/src/meshoptimizer.h umbel_version_line
       REGEX "#define MESHOPTIMIZER_VERSION")
  string(REGEX MATCH "VERSION ([0-9]+)" _ "${umbel_version_line}")
  math(EXPR umbel_major "${CMAKE_MATCH_1} / 1000")
  math(EXPR umbel_minor "${CMAKE_MATCH_1} % 1000 / 10")
  if("${umbel_major}.${umbel_minor}" VERSION_LESS umbel_meshoptimizer_version)
    message(FATAL_ERROR "meshoptimizer: ${umbel_meshoptimizer_found} is version "
                        "${umbel_major}.${umbel_minor}, and Umbel needs 1.0 or newer")
  endif()
  message(STATUS "meshoptimizer ${umbel_major}.${umbel_minor}: built from ${umbel_meshoptimizer_found}")

  add_library(umbel_meshoptimizer OBJECT ${umbel_meshoptimizer_files})
  target_include_directories(umbel_meshoptimizer SYSTEM PUBLIC ${umbel_meshoptimizer_found}/src)
  umbel_compile_options(umbel_meshoptimizer)
  if(NOT MSVC)
    target_compile_options(umbel_meshoptimizer PRIVATE -w)
  endif()
  # For the tests and benchmarks that call meshoptimizer themselves.
  add_library(umbel_meshoptimizer_library STATIC EXCLUDE_FROM_ALL
              $<TARGET_OBJECTS:umbel_meshoptimizer>)
  target_include_directories(umbel_meshoptimizer_library SYSTEM
                             PUBLIC ${umbel_meshoptimizer_found}/src)
  if(EXISTS ${umbel_meshoptimizer_found}/demo/clusterlod.h)
    set(UMBEL_CLUSTERLOD_DIR ${umbel_meshoptimizer_found}/demo)
  endif()
endif()
