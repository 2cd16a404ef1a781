// The extension module umbel._peers: one bind_ function a file.
#pragma once

#include <nanobind/nanobind.h>

namespace umbel::python {

void bind_meshlets(nanobind::module_& module);
void bind_clusterlod(nanobind::module_& module);

}  // namespace umbel::python
