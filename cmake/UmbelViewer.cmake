# The page of the web viewer, for the Python package: built with Node 20 or newer where that is,
# else left out, and `umbel view` says so. Without a network, or if it cannot be built for any other
# reason, it is left out too: nothing else needs it.

set(umbel_viewer_page ${PROJECT_BINARY_DIR}/viewer-page)
file(GLOB_RECURSE umbel_viewer_sources CONFIGURE_DEPENDS
     ${PROJECT_SOURCE_DIR}/viewer/app/* ${PROJECT_SOURCE_DIR}/viewer/packages/umbel/src/*)
add_custom_command(
  OUTPUT ${umbel_viewer_page}/.built
  COMMAND ${CMAKE_COMMAND} -D OUTPUT=${umbel_viewer_page} -D SOURCE=${PROJECT_SOURCE_DIR} -P
          ${PROJECT_SOURCE_DIR}/cmake/build_viewer.cmake
  DEPENDS ${umbel_viewer_sources} ${PROJECT_SOURCE_DIR}/viewer/package-lock.json
          ${PROJECT_SOURCE_DIR}/viewer/package.json ${PROJECT_SOURCE_DIR}/cmake/build_viewer.cmake
  COMMENT "Building the page of the web viewer"
  VERBATIM)
add_custom_target(umbel_viewer DEPENDS ${umbel_viewer_page}/.built)
add_dependencies(umbel_python umbel_viewer)
install(DIRECTORY ${umbel_viewer_page}/ DESTINATION umbel/page COMPONENT python
        PATTERN .built EXCLUDE)
