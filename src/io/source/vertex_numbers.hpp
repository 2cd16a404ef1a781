// Which vertices some triangles use.
#pragma once

#include <cstdint>
#include <vector>

namespace umbel::io {

/// Numbers the vertices that triangles use in rising order: replaces the indices, and gives the
/// vertices.
std::vector<uint32_t> number_vertices(std::vector<uint32_t>& indices);

}  // namespace umbel::io
