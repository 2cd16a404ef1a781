# Builds the viewer's page into OUTPUT, or leaves OUTPUT empty and says why.

file(REMOVE_RECURSE ${OUTPUT})
file(MAKE_DIRECTORY ${OUTPUT})
set(ENV{UMBEL_PAGE} ${OUTPUT})
execute_process(
  COMMAND bash ${SOURCE}/scripts/node.sh build
  RESULT_VARIABLE status OUTPUT_VARIABLE said ERROR_VARIABLE said)
if(NOT EXISTS ${OUTPUT}/index.html)
  message(STATUS "The web viewer is left out: ${said}")
endif()
file(WRITE ${OUTPUT}/.built "")
