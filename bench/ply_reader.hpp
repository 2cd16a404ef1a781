// The least that reads the benchmark meshes: binary little-endian PLY whose vertices are scalar
// properties that begin with float x, y, z and whose faces are `list uchar int`.
#pragma once

#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iterator>
#include <sstream>
#include <string>
#include <vector>

#include "umbel/mesh.hpp"

namespace bench {

[[noreturn]] inline void fail(const std::string& path, const char* why) {
  fprintf(stderr, "%s: %s\n", path.c_str(), why);
  std::exit(1);
}

inline size_t size_of(const std::string& type) {
  if (type == "char" || type == "uchar" || type == "int8" || type == "uint8") return 1;
  if (type == "short" || type == "ushort" || type == "int16" || type == "uint16") return 2;
  return type == "double" || type == "float64" ? 8 : 4;
}

inline umbel::Mesh read_ply(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  const std::string bytes((std::istreambuf_iterator<char>(file)), {});
  const size_t header = bytes.find("end_header\n");
  if (header == std::string::npos || bytes.find("binary_little_endian") > header)
    fail(path, "not a binary little-endian PLY file");
  std::istringstream lines(bytes.substr(0, header));
  size_t vertices = 0, faces = 0, stride = 0;
  bool in_vertices = false;
  for (std::string line; std::getline(lines, line);) {
    std::istringstream words(line);
    std::string word, type, name;
    words >> word >> type >> name;
    if (word == "element") {
      in_vertices = type == "vertex";
      (in_vertices ? vertices : faces) = std::strtoull(name.c_str(), nullptr, 10);
    }
    if (word == "property" && in_vertices) stride += size_of(type);
  }
  const char* at = bytes.data() + header + 11;
  const char* end = bytes.data() + bytes.size();
  if (at + vertices * stride + faces * 13 > end) fail(path, "too short");
  umbel::Mesh mesh;
  mesh.positions.resize(vertices);
  for (size_t i = 0; i < vertices; ++i, at += stride) memcpy(&mesh.positions[i], at, 12);
  mesh.triangles.resize(faces);
  for (size_t i = 0; i < faces; ++i, at += 13) {
    if (*at != 3) fail(path, "has faces that are not triangles");
    memcpy(&mesh.triangles[i], at + 1, 12);
  }
  return mesh;
}

}  // namespace bench
