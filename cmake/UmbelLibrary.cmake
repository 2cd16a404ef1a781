# The library `umbel` (umbel::umbel), static or shared.

configure_file(cmake/version.hpp.in ${PROJECT_BINARY_DIR}/include/umbel/version.hpp)

file(GLOB_RECURSE umbel_sources CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/src/*.cpp)
# Those of umbel::cuda (UmbelCuda.cmake).
list(FILTER umbel_sources EXCLUDE REGEX "/capi/cuda/")

# Several sources in one file compile from scratch in half the time; a single one that has changed
# compiles sooner alone. Those for an instruction set are always compiled alone: their pragmas would
# hold for the sources that follow.
option(UMBEL_UNITY_BUILD "Compile several sources of the library as one" ON)
mark_as_advanced(UMBEL_UNITY_BUILD)
set(umbel_isa_sources ${umbel_sources})
list(FILTER umbel_isa_sources INCLUDE REGEX "_avx(2|512)\\.cpp$")
set_source_files_properties(${umbel_isa_sources} PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)

# The objects are one target, so that tests can link those of a shared library too, whose inner
# functions are not exported.
add_library(umbel_objects OBJECT ${umbel_sources})
umbel_compile_options(umbel_objects)
umbel_precompile_headers(
  umbel_objects <algorithm> <array> <atomic> <cmath> <filesystem> <functional> <memory> <mutex>
  <numeric> <optional> <span> <sstream> <string> <thread> <unordered_map> <vector>)
target_include_directories(
  umbel_objects
  PUBLIC $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}/include>
         $<BUILD_INTERFACE:${PROJECT_BINARY_DIR}/include>
  PRIVATE ${PROJECT_SOURCE_DIR}/src)
target_link_libraries(umbel_objects PUBLIC TBB::tbb PRIVATE umbel_meshoptimizer)
set_target_properties(umbel_objects PROPERTIES UNITY_BUILD ${UMBEL_UNITY_BUILD}
                                                UNITY_BUILD_BATCH_SIZE 16)
if(UMBEL_UNITY_BUILD AND CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  # GCC then takes the sources for headers, in which it warns of types of anonymous namespaces.
  target_compile_options(umbel_objects PRIVATE -Wno-subobject-linkage)
endif()

# Makes a library of the objects, Umbel's and meshoptimizer's.
function(umbel_add_library name kind)
  add_library(${name} ${kind} $<TARGET_OBJECTS:umbel_objects>)
  target_compile_features(${name} PUBLIC cxx_std_20)
  target_include_directories(
    ${name} PUBLIC $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}/include>
                   $<BUILD_INTERFACE:${PROJECT_BINARY_DIR}/include>
                   $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
  target_link_libraries(${name} PRIVATE TBB::tbb)
  if(umbel_meshoptimizer_is_package)
    target_link_libraries(${name} PRIVATE meshoptimizer::meshoptimizer)
  else()
    target_sources(${name} PRIVATE $<TARGET_OBJECTS:umbel_meshoptimizer>)
  endif()
endfunction()

if(UMBEL_BUILD_SHARED)
  umbel_add_library(umbel SHARED)
  target_compile_definitions(umbel_objects PUBLIC UMBEL_SHARED PRIVATE UMBEL_EXPORTS)
  target_compile_definitions(umbel PUBLIC UMBEL_SHARED)
  # oneTBB may come from a Python environment, where the loader would not look for it.
  set_target_properties(umbel PROPERTIES INSTALL_RPATH_USE_LINK_PATH ON)
  if(CMAKE_SYSTEM_NAME STREQUAL "Linux")
    # What is missing should be missed here, not by whoever links the library.
    target_link_options(umbel PRIVATE LINKER:-z,defs)
  endif()
  umbel_add_library(umbel_internal STATIC)
  set_target_properties(umbel_internal PROPERTIES EXCLUDE_FROM_ALL ON)
else()
  umbel_add_library(umbel STATIC)
  add_library(umbel_internal ALIAS umbel)
endif()
add_library(umbel::umbel ALIAS umbel)
set_target_properties(umbel PROPERTIES VERSION ${PROJECT_VERSION}
                                       SOVERSION ${PROJECT_VERSION_MAJOR}.${PROJECT_VERSION_MINOR})
