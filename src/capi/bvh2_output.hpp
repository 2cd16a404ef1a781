// Trees in arrays of a C caller, as umbel_bvh2 and umbel_kary have them.
#pragma once

#include <algorithm>
#include <string>

#include "capi/arguments.hpp"
#include "capi/guard.hpp"
#include "capi/structs.hpp"

namespace umbel::capi {

/// Writes the tree that make() gives, or the room that it needs.
template <typename Node, typename Given, typename Make>
umbel_result hand_out_tree(Given* tree, const char* name, const Make& make) {
  return guard([&] {
    const std::string own = name;
    Given given = read_struct(tree, name);
    given.node_count = given.primitive_count = 0;
    write_struct(given, tree, name);
    const auto nodes = elements<Node>(given.nodes, given.node_capacity, (own + "->nodes").c_str());
    elements<uint32_t>(given.primitives, given.primitive_capacity, (own + "->primitives").c_str());
    const auto made = make();
    given.node_count = made.nodes.size();
    given.primitive_count = made.primitives.size();
    const bool fits = made.nodes.size() <= given.node_capacity &&
                      made.primitives.size() <= given.primitive_capacity;
    if (fits) {
      std::copy(made.nodes.begin(), made.nodes.end(), nodes.begin());
      std::copy(made.primitives.begin(), made.primitives.end(), given.primitives);
    }
    write_struct(given, tree, name);
    if (!fits)
      throw CapacityError{own + " has room for " + std::to_string(given.node_capacity) +
                          " nodes and " + std::to_string(given.primitive_capacity) +
                          " primitives, but needs " + std::to_string(made.nodes.size()) + " and " +
                          std::to_string(made.primitives.size())};
  });
}

}  // namespace umbel::capi
