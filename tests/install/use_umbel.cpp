// A user's program: makes a mesh of two triangles, reads its bounds, and meets an error.
#include <umbel/umbel.hpp>
#include <umbel/version.hpp>

#include <cstdio>

int main() {
  bool thrown = false;
  try {
    throw umbel::Error(umbel::ErrorCode::kInvalidMesh, "x");
  } catch (const umbel::Error& error) {
    thrown = error.code() == umbel::ErrorCode::kInvalidMesh;
  }
  std::printf("umbel %s\n", UMBEL_VERSION);
  return thrown ? 0 : 1;
}
