// Reads the benchmark meshes: PLY as ply_reader.hpp does, and positions and faces of OBJ.
#pragma once

#include <cstdlib>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "ply_reader.hpp"

namespace bench {

/// Faces become fans.
inline umbel::Mesh read_obj(const std::string& path) {
  std::ifstream file(path);
  if (!file) fail(path, "cannot be opened");
  umbel::Mesh mesh;
  for (std::string line; std::getline(file, line);) {
    std::istringstream words(line);
    std::string word;
    words >> word;
    if (word == "v") {
      umbel::Vec3 p{};
      words >> p.x >> p.y >> p.z;
      mesh.positions.push_back(p);
    } else if (word == "f") {
      std::vector<uint32_t> corners;
      while (words >> word) {
        const long index = std::strtol(word.c_str(), nullptr, 10);
        const auto count = static_cast<long>(mesh.positions.size());
        corners.push_back(static_cast<uint32_t>(index < 0 ? count + index : index - 1));
      }
      for (size_t i = 2; i < corners.size(); ++i)
        mesh.triangles.push_back({corners[0], corners[i - 1], corners[i]});
    }
  }
  return mesh;
}

inline umbel::Mesh read_mesh(const std::string& path) {
  return path.ends_with(".obj") ? read_obj(path) : read_ply(path);
}

inline std::string file_name(const std::string& path) { return path.substr(path.rfind('/') + 1); }

}  // namespace bench
