// Tests on real meshes, as far as they are there.
#pragma once

#include <gtest/gtest.h>

#include <optional>
#include <span>

#include "bvh/oracle.hpp"

namespace umbel::testing {

/// Runs check(name, mesh) on those of the files that are there; skips the test where none is.
template <typename Check>
void for_real_meshes(std::span<const char* const> names, const Check& check) {
  size_t read = 0;
  for (const char* name : names) {
    const std::optional<Mesh> mesh = read_mesh(name);
    if (!mesh) continue;
    ++read;
    SCOPED_TRACE(name);
    check(name, *mesh);
  }
  if (read == 0) GTEST_SKIP() << "no meshes in " << data_folder();
}

}  // namespace umbel::testing
