#pragma once

#include <cstddef>

namespace thrust {

template <typename In, typename Map>
struct transform_iterator {
  In in;
  Map map;
  auto operator[](size_t i) const { return map(in[i]); }
};
template <typename In, typename Map>
transform_iterator<In, Map> make_transform_iterator(In in, Map map) {
  return {in, map};
}

}  // namespace thrust
