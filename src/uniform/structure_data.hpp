// What all uniform structures hold.
#pragma once

#include <memory>

#include "query/leaf_store.hpp"
#include "umbel/uniform.hpp"

namespace umbel {

struct UniformData : LeafStore {
  uniform::Statistics statistics{};
  /// Makes one of the same kind without triangles.
  std::unique_ptr<LeafStore> (*without_triangles)() = nullptr;
};

}  // namespace umbel
