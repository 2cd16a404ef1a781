# The extension module umbel._umbel, for benchmarks umbel._peers, and their stubs; the target
# `umbel_python` makes all of them.
# pyproject.toml builds this; the rest of the package is python/umbel.

find_package(Python 3.10 REQUIRED COMPONENTS Interpreter Development.Module)
execute_process(
  COMMAND ${Python_EXECUTABLE} -m nanobind --cmake_dir
  OUTPUT_VARIABLE umbel_nanobind_dir ERROR_QUIET OUTPUT_STRIP_TRAILING_WHITESPACE
  RESULT_VARIABLE umbel_nanobind_status)
if(NOT umbel_nanobind_status EQUAL 0)
  message(FATAL_ERROR "The Python module needs nanobind, and ${Python_EXECUTABLE} does not have it: "
                      "use `pip install .`, which brings it, or `pip install nanobind`.")
endif()
# Under build isolation each build has nanobind in another place.
set(nanobind_DIR ${umbel_nanobind_dir} CACHE PATH "nanobind's CMake files" FORCE)
find_package(nanobind CONFIG REQUIRED)

# The wheel `tbb` puts its library into the environment's lib folder, which is
# .../lib/pythonX.Y/site-packages/umbel/../../.. ; the second form is for lib64.
if(APPLE)
  set(umbel_rpath "@loader_path/../../..;@loader_path/../../../../lib")
else()
  set(umbel_rpath "$ORIGIN/../../..;$ORIGIN/../../../../lib")
endif()

# The module is built into a package that holds only what importing it needs, so that its stub
# can be made before the package is installed and without the package's own dependencies.
set(umbel_stub_root ${PROJECT_BINARY_DIR}/python)
file(MAKE_DIRECTORY ${umbel_stub_root}/umbel)
file(WRITE ${umbel_stub_root}/umbel/__init__.py "")
configure_file(${PROJECT_SOURCE_DIR}/python/umbel/errors.py ${umbel_stub_root}/umbel/errors.py
               COPYONLY)
add_custom_target(umbel_python)

# Builds and installs the extension module umbel.NAME of the sources, and its stub.
function(umbel_python_module name)
  nanobind_add_module(${name} NB_STATIC ${ARGN})
  umbel_compile_options(${name})
  target_include_directories(${name} PRIVATE ${PROJECT_SOURCE_DIR}/python/bindings
                                             ${PROJECT_SOURCE_DIR}/src)
  target_link_libraries(${name} PRIVATE umbel_internal umbel_meshoptimizer_library TBB::tbb)
  set_target_properties(${name} PROPERTIES LIBRARY_OUTPUT_DIRECTORY ${umbel_stub_root}/umbel
                                           INSTALL_RPATH "${umbel_rpath}")
  # _peers imports _umbel.
  nanobind_add_stub(
    ${name}_stub
    MODULE umbel.${name}
    OUTPUT ${umbel_stub_root}/umbel/${name}.pyi
    PYTHON_PATH ${umbel_stub_root}
    DEPENDS _umbel ${name})
  add_dependencies(umbel_python ${name} ${name}_stub)
  install(TARGETS ${name} LIBRARY DESTINATION umbel COMPONENT python)
  install(FILES ${umbel_stub_root}/umbel/${name}.pyi DESTINATION umbel COMPONENT python)
endfunction()

file(GLOB umbel_binding_sources CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/python/bindings/*.cpp)
umbel_python_module(_umbel ${umbel_binding_sources})
umbel_precompile_headers(
  _umbel <nanobind/nanobind.h> <nanobind/ndarray.h> <nanobind/stl/array.h>
  <nanobind/stl/filesystem.h> <nanobind/stl/optional.h> <nanobind/stl/string.h>
  <nanobind/stl/tuple.h> <array> <chrono> <memory> <span> <vector>)

# What `umbel bench` compares with: for development, not for wheels.
if(UMBEL_BUILD_BENCH)
  file(GLOB umbel_peer_sources CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/python/peers/*.cpp)
  umbel_python_module(_peers ${umbel_peer_sources} ${PROJECT_SOURCE_DIR}/python/bindings/bind.cpp)
  if(UMBEL_CLUSTERLOD_DIR)
    target_include_directories(_peers SYSTEM PRIVATE ${UMBEL_CLUSTERLOD_DIR})
    target_compile_definitions(_peers PRIVATE UMBEL_HAS_CLUSTERLOD)
  endif()
endif()
