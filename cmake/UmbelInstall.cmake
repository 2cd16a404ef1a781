# `cmake --install`, and what find_package(umbel) reads.

include(CMakePackageConfigHelpers)
set(umbel_cmake_dir ${CMAKE_INSTALL_LIBDIR}/cmake/umbel)

install(
  TARGETS umbel
  EXPORT umbel-targets
  RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT library
  LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT library
  ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT library)
install(DIRECTORY ${PROJECT_SOURCE_DIR}/include/ ${PROJECT_BINARY_DIR}/include/
        DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} COMPONENT library
        FILES_MATCHING PATTERN "*.hpp" PATTERN "*.h")
install(EXPORT umbel-targets NAMESPACE umbel:: DESTINATION ${umbel_cmake_dir} COMPONENT library)
install(FILES ${PROJECT_SOURCE_DIR}/LICENSE DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT library)

# A shared library carries its own link to these; whoever links the static one must find them.
set(umbel_find_dependencies "")
if(NOT UMBEL_BUILD_SHARED)
  string(APPEND umbel_find_dependencies "find_dependency(TBB ${umbel_tbb_version})\n")
  if(umbel_meshoptimizer_is_package)
    string(APPEND umbel_find_dependencies "find_dependency(meshoptimizer)\n")
  endif()
endif()
configure_package_config_file(
  ${PROJECT_SOURCE_DIR}/cmake/umbel-config.cmake.in ${PROJECT_BINARY_DIR}/umbel-config.cmake
  INSTALL_DESTINATION ${umbel_cmake_dir})
# For projects that do not use CMake. Its prefix is relative to where the file is, so that a tree may
# be moved. A program that links the static library needs the C++ runtime, oneTBB and meshoptimizer
# too, so they are in Libs: pkg-config knows only `--static`, which nobody gives for one library.
file(RELATIVE_PATH umbel_pc_up /${CMAKE_INSTALL_LIBDIR}/pkgconfig /)
string(REGEX REPLACE "/$" "" umbel_pc_up "${umbel_pc_up}")
set(umbel_pc_prefix "\${pcfiledir}/${umbel_pc_up}")
set(umbel_pc_libs "")
set(umbel_pc_cflags "")
if(UMBEL_BUILD_SHARED)
  set(umbel_pc_cflags " -DUMBEL_SHARED")
else()
  if(umbel_meshoptimizer_is_package)
    string(APPEND umbel_pc_libs " -lmeshoptimizer")
  endif()
  string(APPEND umbel_pc_libs " -ltbb")
  foreach(library IN LISTS CMAKE_CXX_IMPLICIT_LINK_LIBRARIES)
    if(library MATCHES "^(stdc\\+\\+|c\\+\\+|m)$")
      string(APPEND umbel_pc_libs " -l${library}")
    endif()
  endforeach()
endif()
configure_file(${PROJECT_SOURCE_DIR}/cmake/umbel.pc.in ${PROJECT_BINARY_DIR}/umbel.pc @ONLY)
install(FILES ${PROJECT_BINARY_DIR}/umbel.pc DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig
        COMPONENT library)

# Before 1.0, a minor version may change the interface.
write_basic_package_version_file(${PROJECT_BINARY_DIR}/umbel-config-version.cmake
                                 COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/umbel-config.cmake
              ${PROJECT_BINARY_DIR}/umbel-config-version.cmake
        DESTINATION ${umbel_cmake_dir} COMPONENT library)
