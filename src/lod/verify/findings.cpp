// Numbers as they stand in the sentences of a verification report.
#include "lod/verify/findings.hpp"

#include <cstdio>

namespace umbel::lod {

std::string text(double value) {
  char buffer[32];
  std::snprintf(buffer, sizeof buffer, "%.9g", value);
  return buffer;
}

std::string text(const Vec3& p) {
  char buffer[96];
  std::snprintf(buffer, sizeof buffer, "(%.9g, %.9g, %.9g)", double{p.x}, double{p.y}, double{p.z});
  return buffer;
}

std::string text(const Sphere& sphere) {
  return "sphere of radius " + text(sphere.radius) + " around " + text(sphere.center);
}

std::string number(uint64_t value) { return std::to_string(value); }

}  // namespace umbel::lod
