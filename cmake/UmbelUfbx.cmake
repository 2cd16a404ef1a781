# Lets obj_bench compare with ufbx.

include(UmbelCargo)
umbel_bench_crate(ufbx ufbx ufbx obj_bench)
