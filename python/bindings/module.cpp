// The extension module umbel._umbel: one bind_ function a concept, each in its own file.
#include "bind.hpp"
#include "umbel/version.hpp"

NB_MODULE(_umbel, module) {
  using namespace umbel::python;
  module.doc() = "Umbel's C++ library; use it through the package umbel.";
  module.def("version", [] { return UMBEL_VERSION; }, "The version of the library.");
  bind_errors(module);
  bind_mesh(module);
  bind_obj(module);
  bind_source(module);
  bind_cluster(module);
  bind_frame_clusters(module);
  bind_lod(module);
  bind_scale(module);
  bind_asset(module);
  bind_stream(module);
  bind_instance_tree(module);
  bind_trace(module);
  bind_queries(module);
  bind_bvh(module);
  bind_dynamic_tree(module);
  bind_kdtree(module);
  bind_uniform(module);
  bind_meshopt(module);
  bind_meshopt_encode(module);
  bind_timed_clusters(module);
}
