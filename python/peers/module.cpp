// The extension module umbel._peers: meshoptimizer's own builders under the clock of `umbel bench`.
// It is built with the programs in bench/, and no wheel has it.
#include <meshoptimizer.h>
#include <nanobind/stl/string.h>

#include <string>

#include "peers.hpp"

NB_MODULE(_peers, module) {
  using namespace umbel::python;
  module.doc() = "Libraries that Umbel is compared with.";
  // Its types and its translation of errors serve this module, too.
  nanobind::module_::import_("umbel._umbel");
  module.def(
      "meshoptimizer_version",
      [] {
        return std::to_string(MESHOPTIMIZER_VERSION / 1000) + "." +
               std::to_string(MESHOPTIMIZER_VERSION % 1000 / 10);
      },
      "The version of meshoptimizer that is built in.");
  bind_meshlets(module);
  bind_clusterlod(module);
}
