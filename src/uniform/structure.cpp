// What the uniform structures share.
#include "uniform/structure_data.hpp"

namespace umbel::uniform {
namespace {

const UniformData& data_of(const LeafStore& store) {
  return static_cast<const UniformData&>(store);
}

}  // namespace

UniformStructure::UniformStructure(std::unique_ptr<LeafStore> store)
    : TriangleQueries(std::move(store)) {}
UniformStructure::~UniformStructure() = default;
// What was moved from stays without triangles, so that every query on it has an answer.
UniformStructure::UniformStructure(UniformStructure&& other)
    : TriangleQueries(data_of(*other.store_).without_triangles()) {
  swap(other);
}
UniformStructure& UniformStructure::operator=(UniformStructure&& other) noexcept {
  swap(other);
  return *this;
}

Statistics UniformStructure::statistics() const { return data_of(*store_).statistics; }

}  // namespace umbel::uniform
