# Finds oneTBB: the imported target TBB::tbb.
#
# 1. The system's (or any that CMAKE_PREFIX_PATH or TBB_DIR names).
# 2. The wheel `tbb-devel`, in the environment of the Python interpreter that runs this build.
#
# A Python package tries these the other way round, because it depends on the wheel `tbb` at run
# time: what it is compiled against must not be newer than what it is run with.

set(umbel_tbb_version 2021.5)

# Sets `result` to the folder of the wheel's TBBConfig.cmake, or to nothing.
function(umbel_find_tbb_wheel result)
  set(${result} "" PARENT_SCOPE)
  if(NOT Python_EXECUTABLE)
    find_package(Python 3.9 QUIET COMPONENTS Interpreter)
  endif()
  if(NOT Python_EXECUTABLE)
    return()
  endif()
  set(script
      "import importlib.metadata as m"
      "d = m.distribution('tbb-devel')"
      "print(next(d.locate_file(f).resolve().parent for f in d.files if f.name == 'TBBConfig.cmake'))")
  list(JOIN script "\n" script)
  execute_process(
    COMMAND ${Python_EXECUTABLE} -c "${script}"
    OUTPUT_VARIABLE folder ERROR_QUIET OUTPUT_STRIP_TRAILING_WHITESPACE
    RESULT_VARIABLE status)
  if(status EQUAL 0)
    file(TO_CMAKE_PATH "${folder}" folder)
    set(${result} "${folder}" PARENT_SCOPE)
  endif()
endfunction()

macro(umbel_use_tbb_wheel)
  umbel_find_tbb_wheel(umbel_tbb_wheel)
  if(umbel_tbb_wheel)
    find_package(TBB ${umbel_tbb_version} QUIET CONFIG PATHS ${umbel_tbb_wheel} NO_DEFAULT_PATH)
  endif()
endmacro()

# A build folder may outlive the Python environment that it found oneTBB in.
if(TBB_DIR AND NOT EXISTS "${TBB_DIR}/TBBConfig.cmake")
  unset(TBB_DIR CACHE)
endif()

if(SKBUILD)
  umbel_use_tbb_wheel()
endif()
if(NOT TBB_FOUND)
  find_package(TBB ${umbel_tbb_version} QUIET CONFIG)
endif()
if(NOT TBB_FOUND)
  umbel_use_tbb_wheel()
endif()
if(NOT TBB_FOUND)
  message(
    FATAL_ERROR
      "Umbel needs oneTBB >= ${umbel_tbb_version}, and neither the system nor Python has it: "
      "install libtbb-dev (Debian, Ubuntu), tbb-devel (Fedora), tbb (Homebrew), "
      "or `pip install tbb-devel`.")
endif()
message(STATUS "oneTBB ${TBB_VERSION}: ${TBB_DIR}")
