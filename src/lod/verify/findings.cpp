// Numbers as they stand in the sentences of a verification report.
#include "lod/verify/findings.hpp"

#include "base/printed.hpp"

namespace umbel::lod {

std::string text(float value) { return printed(value); }

std::string text(const Vec3& p) { return printed_vector(p); }

std::string text(const Sphere& sphere) {
  return "sphere of radius " + text(sphere.radius) + " around " + text(sphere.center);
}

std::string number(uint64_t value) { return std::to_string(value); }

}  // namespace umbel::lod
