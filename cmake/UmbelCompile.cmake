# How every target of Umbel is compiled: umbel_compile_options(target), and
# umbel_precompile_headers(target headers...) where many files include the same headers of others.

# Floating-point contraction (fused multiply-add) rounds once where the source rounds twice.
# Without this flag results would depend on the compiler and on -march, and the promise of the
# same bytes everywhere would not hold.
set(umbel_float_options "$<IF:$<CXX_COMPILER_ID:MSVC>,/fp:precise,-ffp-contract=off>")

function(umbel_compile_options target)
  target_compile_features(${target} PUBLIC cxx_std_20)
  set_target_properties(
    ${target}
    PROPERTIES CXX_EXTENSIONS OFF
               POSITION_INDEPENDENT_CODE ON
               CXX_VISIBILITY_PRESET hidden
               VISIBILITY_INLINES_HIDDEN ON)
  target_compile_options(${target} PRIVATE ${umbel_float_options})
  if(MSVC)
    target_compile_options(${target} PRIVATE /W4 $<$<BOOL:${UMBEL_WERROR}>:/WX>)
    target_compile_definitions(${target} PRIVATE NOMINMAX)
  else()
    target_compile_options(${target} PRIVATE -Wall -Wextra $<$<BOOL:${UMBEL_WERROR}>:-Werror>)
  endif()
endfunction()

# Parsing these is up to half of the time that a file takes. Each file includes what it uses all the
# same: `make lint` reads it without. Not with ccache, which cannot tell what such a header holds.
option(UMBEL_PRECOMPILE_HEADERS "Precompile the standard library's headers" ON)
mark_as_advanced(UMBEL_PRECOMPILE_HEADERS)
function(umbel_precompile_headers target)
  if(UMBEL_PRECOMPILE_HEADERS AND NOT CMAKE_CXX_COMPILER_LAUNCHER)
    target_precompile_headers(${target} PRIVATE ${ARGN})
    # GCC no longer knows then that the code it warns of is the standard library's.
    if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
      target_compile_options(${target} PRIVATE -Wno-array-bounds -Wno-nonnull -Wno-restrict
                                               -Wno-stringop-overflow -Wno-stringop-overread)
    endif()
  endif()
endfunction()
