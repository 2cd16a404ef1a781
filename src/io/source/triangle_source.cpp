#include "io/source/triangle_source.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <exception>
#include <string>
#include <type_traits>
#include <utility>

#include "base/in_order.hpp"
#include "base/math.hpp"

namespace umbel::io {
namespace {

bool is_finite(const Vec2& v) { return std::isfinite(v.x) && std::isfinite(v.y); }
bool is_finite(const Vec4& v) { return is_finite(Vec3{v.x, v.y, v.z}) && std::isfinite(v.w); }

/// Where to begin, and what to say.
struct Place {
  const std::string& name;
  uint64_t first;
  size_t vertex, triangle;
};

template <typename Value>
void check_stream(const TriangleBlock& block, const std::vector<Value>& values, const Place& place,
                  const char* what) {
  const auto from = static_cast<ptrdiff_t>(std::min(place.vertex, values.size()));
  const auto finite = [](const Value& v) { return is_finite(v); };
  if (std::all_of(values.begin() + from, values.end(), finite)) return;
  for (size_t i = place.triangle; i < block.triangles.size(); ++i)
    for (uint32_t v : block.triangles[i]) {
      if (is_finite(values[v])) continue;
      std::string text = place.name + ": triangle " +
                         std::to_string(place.first + i - place.triangle) + " has a vertex whose " +
                         what + " is not finite";
      if constexpr (std::is_same_v<Value, Vec3d>) {
        std::array<char, 96> numbers;
        std::snprintf(numbers.data(), numbers.size(), ": (%g, %g, %g)", values[v].x, values[v].y,
                      values[v].z);
        text += numbers.data();
      }
      throw Error(ErrorCode::kInvalidMesh, text);
    }
}

}  // namespace

void for_each_block(const TriangleSource& source, uint64_t begin, uint64_t end, uint64_t size,
                    const std::function<void(TriangleBlock&&)>& visit) {
  struct Ahead {
    TriangleBlock block;
    std::exception_ptr error;
  };
  const auto count = static_cast<size_t>((end - begin + size - 1) / size);
  in_order<Ahead>(
      count,
      [&](size_t k, Ahead& ahead) {
        const uint64_t at = begin + k * size;
        try {
          ahead.block = source.read(at, std::min(at + size, end));
        } catch (...) {
          ahead.error = std::current_exception();
        }
      },
      [&](size_t, Ahead& ahead) {
        if (ahead.error) std::rethrow_exception(ahead.error);
        visit(std::move(ahead.block));
      },
      [](size_t, Ahead& ahead) { ahead.block = TriangleBlock(); });
}

void check_finite(const TriangleBlock& block, const std::string& name, uint64_t first,
                  size_t vertex, size_t triangle) {
  const Place place{name, first, vertex, triangle};
  check_stream(block, block.positions, place, "position");
  check_stream(block, block.normals, place, "normal");
  check_stream(block, block.tangents, place, "tangent");
  check_stream(block, block.uvs, place, "texture coordinate");
  check_stream(block, block.colors, place, "colour");
}

}  // namespace umbel::io
