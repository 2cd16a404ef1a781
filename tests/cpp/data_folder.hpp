// Where the real meshes are; tests that use them skip where there are none.
#pragma once

#include <cstdlib>
#include <filesystem>

namespace umbel::testing {

inline std::filesystem::path data_folder() {
  if (const char* folder = std::getenv("UMBEL_DATA")) return folder;
  return std::filesystem::path(__FILE__).parent_path() / "../../../shared/data";
}

}  // namespace umbel::testing
