# Lets ray_bench compare with tinybvh, which needs AVX2.

include(UmbelCargo)
umbel_bench_crate(tinybvh tinybvh-rs ffi/tinybvh ray_bench -march=native)
if(TARGET ray_bench)
  target_link_libraries(ray_bench PRIVATE ${CMAKE_DL_LIBS})
endif()
