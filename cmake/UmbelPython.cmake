# The extension module umbel._umbel and its stub; the target `umbel_python` makes both.
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

file(GLOB umbel_binding_sources CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/python/bindings/*.cpp)
nanobind_add_module(_umbel NB_STATIC ${umbel_binding_sources})
umbel_compile_options(_umbel)
target_include_directories(_umbel PRIVATE ${PROJECT_SOURCE_DIR}/python/bindings ${PROJECT_SOURCE_DIR}/src)
target_link_libraries(_umbel PRIVATE umbel_internal umbel_meshoptimizer_library TBB::tbb)
if(UMBEL_CLUSTERLOD_DIR)
  target_include_directories(_umbel SYSTEM PRIVATE ${UMBEL_CLUSTERLOD_DIR})
  target_compile_definitions(_umbel PRIVATE UMBEL_HAS_CLUSTERLOD)
endif()

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
set_target_properties(_umbel PROPERTIES LIBRARY_OUTPUT_DIRECTORY ${umbel_stub_root}/umbel
                                        INSTALL_RPATH "${umbel_rpath}")
nanobind_add_stub(
  umbel_stub
  MODULE umbel._umbel
  OUTPUT ${umbel_stub_root}/umbel/_umbel.pyi
  PYTHON_PATH ${umbel_stub_root}
  DEPENDS _umbel)
add_custom_target(umbel_python DEPENDS _umbel umbel_stub)

install(TARGETS _umbel LIBRARY DESTINATION umbel COMPONENT python)
install(FILES ${umbel_stub_root}/umbel/_umbel.pyi DESTINATION umbel COMPONENT python)
