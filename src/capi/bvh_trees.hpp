// Trees in arrays of a C caller, binary or not, and hierarchies made of them.
#pragma once

#include <algorithm>

#include "capi/bvh_input.hpp"
#include "capi/cluster_input.hpp"
#include "capi/guard.hpp"
#include "capi/hand_out.hpp"
#include "capi/structs.hpp"

namespace umbel::capi {

/// The tree that a C caller holds; copied, since the library takes vectors.
template <typename Tree, typename Given>
Tree copied_tree(const Given* tree) {
  using Node = typename decltype(Tree::nodes)::value_type;
  const Given given = read_struct(tree, "tree");
  const auto nodes = elements<const Node>(given.nodes, given.node_count, "tree->nodes");
  const auto primitives =
      elements<const uint32_t>(given.primitives, given.primitive_count, "tree->primitives");
  Tree result;
  result.nodes.assign(nodes.begin(), nodes.end());
  result.primitives.assign(primitives.begin(), primitives.end());
  return result;
}

/// Runs make(config, options) and writes the tree that it gives, or what room it needs.
template <typename Node, typename Given, typename Make>
umbel_result build_tree(const umbel_bvh_config* config, const umbel_build_options* options,
                        Given* tree, const Make& make) {
  return guard([&] {
    Given given = read_struct(tree, "tree");
    given.node_count = given.primitive_count = 0;
    write_struct(given, tree, "tree");
    const auto nodes = elements<Node>(given.nodes, given.node_capacity, "tree->nodes");
    elements<uint32_t>(given.primitives, given.primitive_capacity, "tree->primitives");
    const auto made = make(bvh_config(config).tree, build_options(options));
    given.node_count = made.nodes.size();
    given.primitive_count = made.primitives.size();
    const bool fits = made.nodes.size() <= given.node_capacity &&
                      made.primitives.size() <= given.primitive_capacity;
    if (fits) {
      std::copy(made.nodes.begin(), made.nodes.end(), nodes.begin());
      std::copy(made.primitives.begin(), made.primitives.end(), given.primitives);
    }
    write_struct(given, tree, "tree");
    if (!fits)
      throw CapacityError{"tree has room for " + std::to_string(given.node_capacity) +
                          " nodes and " + std::to_string(given.primitive_capacity) +
                          " primitives, but needs " + std::to_string(made.nodes.size()) + " and " +
                          std::to_string(made.primitives.size())};
  });
}

inline umbel_bvh2_statistics as_c(const bvh::Statistics& found) {
  umbel_bvh2_statistics result{};
  result.nodes = found.nodes;
  result.leaves = found.leaves;
  result.max_depth = found.max_depth;
  result.references = found.references;
  result.sah_cost = found.sah_cost;
  return result;
}

}  // namespace umbel::capi
