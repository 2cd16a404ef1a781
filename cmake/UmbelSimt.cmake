# The kernels of umbel::cuda on an emulated device (tests/simt), with and without ThreadSanitizer:
# umbel_simt_tests and umbel_simt_exec_tests, and the same names with _tsan. `make simt` builds and
# runs them; nothing else does.

if(NOT CMAKE_SYSTEM_NAME STREQUAL "Linux" OR NOT CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  return()
endif()

file(GLOB umbel_simt_machine CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/tests/simt/machine/*.cpp)
file(GLOB umbel_simt_kernels CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/tests/simt/kernels/*.cpp)
file(GLOB umbel_simt_tests CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/tests/simt/device_tests/*.cpp)

function(umbel_simt_options target)
  umbel_compile_options(${target})
  # Inline functions are visible, or the two sides of the tests would not share exceptions.
  set_target_properties(${target} PROPERTIES CXX_VISIBILITY_PRESET default
                                             VISIBILITY_INLINES_HIDDEN OFF EXCLUDE_FROM_ALL ON)
  target_compile_options(${target} PRIVATE -O1 -g1 -fno-omit-frame-pointer -Wno-dangling-else)
  target_include_directories(
    ${target} PRIVATE ${PROJECT_SOURCE_DIR}/tests/simt/shim ${PROJECT_SOURCE_DIR}/tests/simt/machine
                      ${PROJECT_SOURCE_DIR}/src ${PROJECT_SOURCE_DIR}/tests
                      ${PROJECT_SOURCE_DIR}/tests/cuda ${PROJECT_SOURCE_DIR}/tests/cpp)
endfunction()

# What a CUDA compiler would compile.
function(umbel_simt_device_code target)
  target_compile_definitions(${target} PRIVATE UMBEL_SIMT)
  target_compile_options(
    ${target} PRIVATE -D__CUDACC__ -D__CUDA_ARCH__=900 -include cuda_runtime.h ${ARGN})
endfunction()

add_library(umbel_simt_machine OBJECT ${umbel_simt_machine})
umbel_simt_options(umbel_simt_machine)
target_compile_options(umbel_simt_machine PRIVATE -O2)

# The processor's side.
file(GLOB umbel_simt_capi CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/src/capi/cuda/*.cpp)
add_library(umbel_simt_test_objects OBJECT ${umbel_simt_tests} ${umbel_simt_capi})
umbel_simt_options(umbel_simt_test_objects)
target_compile_definitions(umbel_simt_test_objects PRIVATE UMBEL_SIMT)
add_library(umbel_simt_main OBJECT ${PROJECT_SOURCE_DIR}/tests/simt/main.cpp)
umbel_simt_options(umbel_simt_main)
foreach(target umbel_simt_test_objects umbel_simt_main)
  target_link_libraries(${target} PRIVATE umbel_internal TBB::tbb GTest::gtest_main)
endforeach()

# The programs, with these options for what a device runs.
function(umbel_add_simt suffix)
  # A library, because its inline functions are not those that the processor's side has.
  add_library(umbel_simt${suffix} SHARED ${umbel_simt_kernels} $<TARGET_OBJECTS:umbel_simt_machine>)
  umbel_simt_options(umbel_simt${suffix})
  umbel_simt_device_code(umbel_simt${suffix} ${ARGN})
  target_link_options(umbel_simt${suffix} PRIVATE LINKER:-Bsymbolic ${ARGN})
  target_link_libraries(umbel_simt${suffix} PRIVATE umbel_internal TBB::tbb ${CMAKE_DL_LIBS})

  add_executable(
    umbel_simt_tests${suffix} $<TARGET_OBJECTS:umbel_simt_test_objects>
                              $<TARGET_OBJECTS:umbel_simt_main>
                              $<TARGET_OBJECTS:umbel_device_tests_on_processor>)
  # The executor's own tests have kernels in them.
  add_executable(umbel_simt_exec_tests${suffix} ${PROJECT_SOURCE_DIR}/tests/simt/exec_tests.cpp
                                                $<TARGET_OBJECTS:umbel_simt_main>)
  # Position-independent as a library, or it would have copies of the machine's variables.
  umbel_simt_device_code(umbel_simt_exec_tests${suffix} -fPIC ${ARGN})
  foreach(program umbel_simt_tests${suffix} umbel_simt_exec_tests${suffix})
    umbel_simt_options(${program})
    target_link_options(${program} PRIVATE ${ARGN})
    target_link_libraries(
      ${program} PRIVATE umbel_simt${suffix} umbel_internal umbel_meshoptimizer_library TBB::tbb
                         GTest::gtest_main)
  endforeach()
endfunction()

umbel_add_simt("")
umbel_add_simt(_tsan -fsanitize=thread --param=tsan-distinguish-volatile=1)
