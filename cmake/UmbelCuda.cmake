# UMBEL_CUDA: the library `umbel_cuda` (umbel::cuda), its tests and its benchmark. AUTO builds them
# where there is a CUDA compiler.

set(UMBEL_CUDA AUTO CACHE STRING "Build umbel::cuda: AUTO (where there is a CUDA compiler), ON, OFF")
set_property(CACHE UMBEL_CUDA PROPERTY STRINGS AUTO ON OFF)

# umbel::cuda is the first to need CUDA, so this decides whether there is any.
set(umbel_has_cuda OFF)
if(UMBEL_CUDA STREQUAL "AUTO")
  include(CheckLanguage)
  check_language(CUDA)
  if(CMAKE_CUDA_COMPILER)
    set(umbel_has_cuda ON)
  endif()
elseif(UMBEL_CUDA)
  set(umbel_has_cuda ON)
endif()
if(NOT umbel_has_cuda)
  return()
endif()

# Machine code for Turing, Ampere, Ada and Hopper, and PTX for what comes after.
if(NOT DEFINED CMAKE_CUDA_ARCHITECTURES)
  set(CMAKE_CUDA_ARCHITECTURES 75-real 80-real 86-real 89-real 90)
endif()
enable_language(CUDA)
find_package(CUDAToolkit REQUIRED)
if(CUDAToolkit_VERSION VERSION_LESS 12.4)
  message(FATAL_ERROR "umbel::cuda needs CUDA 12.4 or newer, and this is ${CUDAToolkit_VERSION}; "
                      "-DUMBEL_CUDA=OFF builds without it")
endif()
message(STATUS "CUDA ${CUDAToolkit_VERSION}: ${CMAKE_CUDA_COMPILER}, for ${CMAKE_CUDA_ARCHITECTURES}")

# How every target with CUDA sources is compiled. Nothing is contracted into fused operations, as on
# the processor: the same bytes everywhere.
function(umbel_cuda_compile_options target)
  set_target_properties(
    ${target}
    PROPERTIES CXX_STANDARD 20
               CXX_EXTENSIONS OFF
               POSITION_INDEPENDENT_CODE ON
               CUDA_RUNTIME_LIBRARY Static)
  target_compile_options(
    ${target}
    PRIVATE
      # CMake before 3.26 knows no CUDA_STANDARD 20.
      $<$<COMPILE_LANGUAGE:CUDA>:-std=c++20>
      $<$<COMPILE_LANGUAGE:CUDA>:--extended-lambda --expt-relaxed-constexpr --fmad=false>
      $<$<COMPILE_LANGUAGE:CUDA>:-Xcompiler=-Wall,-Wextra,-ffp-contract=off>
      $<$<COMPILE_LANGUAGE:CXX>:-Wall;-Wextra;${umbel_float_options}>
      $<$<AND:$<COMPILE_LANGUAGE:CUDA>,$<BOOL:${UMBEL_WERROR}>>:-Werror=all-warnings>)
  target_include_directories(${target} PRIVATE ${PROJECT_SOURCE_DIR}/src)
endfunction()

file(GLOB umbel_cuda_sources CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/src/cuda/*.cu
     ${PROJECT_SOURCE_DIR}/src/capi/cuda/*.cpp)
add_library(umbel_cuda STATIC ${umbel_cuda_sources})
umbel_cuda_compile_options(umbel_cuda)
target_link_libraries(umbel_cuda PUBLIC umbel_internal PRIVATE TBB::tbb CUDA::cudart_static)
add_library(umbel::cuda ALIAS umbel_cuda)
set_target_properties(umbel_cuda PROPERTIES EXPORT_NAME cuda)

# Installed beside umbel::umbel, where it links that very library.
if(UMBEL_INSTALL AND NOT UMBEL_BUILD_SHARED)
  install(TARGETS umbel_cuda EXPORT umbel-cuda-targets
          ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT library)
  install(EXPORT umbel-cuda-targets NAMESPACE umbel:: DESTINATION ${umbel_cmake_dir}
          COMPONENT library)
endif()

# The C interface by itself, for Python and other languages that load libraries.
add_library(umbel_cuda_c SHARED $<TARGET_OBJECTS:umbel_cuda>)
set_target_properties(umbel_cuda_c PROPERTIES LINKER_LANGUAGE CXX)
target_link_libraries(umbel_cuda_c PRIVATE umbel_internal TBB::tbb CUDA::cudart_static)
# As it lies in the wheel umbel-cuda: oneTBB's wheel puts its library into the environment's lib
# folder; no other runtime is needed.
set_target_properties(umbel_cuda_c PROPERTIES BUILD_RPATH "$ORIGIN/../../..;$ORIGIN/../../../../lib")
target_link_options(umbel_cuda_c PRIVATE
                    $<$<CXX_COMPILER_ID:GNU>:-static-libstdc++;-static-libgcc>)

if(UMBEL_BUILD_TESTS)
  file(GLOB umbel_cuda_test_sources CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/tests/cuda/*.cu)
  add_executable(umbel_cuda_tests ${umbel_cuda_test_sources}
                                  $<TARGET_OBJECTS:umbel_device_tests_on_processor>)
  umbel_cuda_compile_options(umbel_cuda_tests)
  target_include_directories(umbel_cuda_tests PRIVATE ${PROJECT_SOURCE_DIR}/tests/cpp)
  target_link_libraries(umbel_cuda_tests PRIVATE umbel_cuda umbel_internal TBB::tbb
                                                 CUDA::cudart_static GTest::gtest_main)
  gtest_discover_tests(umbel_cuda_tests WORKING_DIRECTORY ${PROJECT_SOURCE_DIR}
                       DISCOVERY_MODE PRE_TEST DISCOVERY_TIMEOUT 60
                       PROPERTIES LABELS cuda TIMEOUT 600)
endif()

if(UMBEL_BUILD_BENCH)
  add_executable(cuda_frame_example ${PROJECT_SOURCE_DIR}/examples/cuda/frame_graph.cu)
  foreach(name cuda_bench cuda_bvh_bench cuda_paths_bench cuda_query_bench)
    add_executable(${name} ${PROJECT_SOURCE_DIR}/bench/cuda/${name}.cu)
  endforeach()
  foreach(name cuda_frame_example cuda_bench cuda_bvh_bench cuda_paths_bench cuda_query_bench)
    umbel_cuda_compile_options(${name})
    set_target_properties(${name} PROPERTIES RUNTIME_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/bench)
    target_include_directories(${name} PRIVATE ${PROJECT_SOURCE_DIR}/bench)
    target_link_libraries(${name} PRIVATE umbel_cuda umbel_internal TBB::tbb CUDA::cudart_static)
  endforeach()
endif()
