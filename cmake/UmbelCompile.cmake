# How every target of Umbel is compiled: umbel_compile_options(target).

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
