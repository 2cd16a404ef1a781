// Rejects meshes that later stages could not make sense of, naming the first offender: the
// lowest triangle, its first bad corner, that corner's index or value. Only vertices that
// triangles use are judged.
#include <atomic>
#include <bit>
#include <cstdio>

#include "base/parallel.hpp"
#include "base/progress.hpp"
#include "mesh/streams.hpp"

namespace umbel {
namespace {

template <typename Vector>
bool all_finite(const Vector& v) {
  constexpr uint32_t kExponent = 0x7f800000u;
  bool finite = true;
  for (uint32_t bits : std::bit_cast<std::array<uint32_t, sizeof(Vector) / 4>>(v))
    finite &= (bits & kExponent) != kExponent;
  return finite;
}

template <typename Vector>
bool all_finite(std::span<const Vector> stream) {
  std::atomic<bool> finite{true};
  parallel_chunks(stream.size(), size_t{1} << 16, [&](size_t begin, size_t end) {
    bool chunk_finite = true;
    for (size_t i = begin; i < end; ++i) chunk_finite &= all_finite(stream[i]);
    if (!chunk_finite) finite.store(false, std::memory_order_relaxed);
  });
  return finite;
}

bool every_vertex_is_finite(const MeshView& mesh) {
  return all_finite(mesh.positions) && all_finite(mesh.normals) && all_finite(mesh.tangents) &&
         all_finite(mesh.uvs) && all_finite(mesh.colors);
}

template <typename Vector>
bool bad_in(std::span<const Vector> stream, uint32_t vertex) {
  return !stream.empty() && !all_finite(stream[vertex]);
}

bool vertex_is_finite(const MeshView& mesh, uint32_t vertex) {
  return !(bad_in(mesh.positions, vertex) || bad_in(mesh.normals, vertex) ||
           bad_in(mesh.tangents, vertex) || bad_in(mesh.uvs, vertex) ||
           bad_in(mesh.colors, vertex));
}

template <typename Vector>
std::string printed(const Vector& v) {
  std::string text = "(";
  for (float f : std::bit_cast<std::array<float, sizeof(Vector) / 4>>(v)) {
    char number[32];
    std::snprintf(number, sizeof number, "%.9g", static_cast<double>(f));
    if (text.size() > 1) text += ", ";
    text += f != f ? "nan" : number;
  }
  return text + ")";
}

std::string offending_value(const MeshView& mesh, uint32_t vertex) {
  const auto sentence = [&](const char* name, const auto& stream) {
    return std::string("the ") + name + " of vertex " + std::to_string(vertex) + " is " +
           printed(stream[vertex]) + ", which is not finite";
  };
  if (bad_in(mesh.positions, vertex)) return sentence("position", mesh.positions);
  if (bad_in(mesh.normals, vertex)) return sentence("normal", mesh.normals);
  if (bad_in(mesh.tangents, vertex)) return sentence("tangent", mesh.tangents);
  if (bad_in(mesh.uvs, vertex)) return sentence("texture coordinate", mesh.uvs);
  return sentence("colour", mesh.colors);
}

[[noreturn]] void reject(const MeshView& mesh, size_t triangle, uint32_t corner) {
  const uint32_t vertex = mesh.triangles[triangle][corner];
  std::string sentence =
      "triangle " + std::to_string(triangle) + ", corner " + std::to_string(corner) + ": ";
  if (vertex >= mesh.positions.size())
    sentence += "vertex index " + std::to_string(vertex) + " is out of range, the mesh has " +
                std::to_string(mesh.positions.size()) + " vertices";
  else
    sentence += offending_value(mesh, vertex);
  throw Error(ErrorCode::kInvalidMesh, sentence);
}

/// The lowest triangle that `is_bad`, or the number of triangles.
template <typename IsBad>
size_t first_bad_triangle(const MeshView& mesh, const IsBad& is_bad) {
  std::atomic<size_t> first{mesh.triangles.size()};
  parallel_chunks(mesh.triangles.size(), kTriangleChunk, [&](size_t begin, size_t end) {
    if (begin > first.load(std::memory_order_relaxed)) return;
    for (size_t i = begin; i < end; ++i) {
      if (!is_bad(i)) continue;
      size_t seen = first.load(std::memory_order_relaxed);
      while (i < seen && !first.compare_exchange_weak(seen, i)) {
      }
      return;
    }
  });
  return first;
}

size_t first_index_out_of_range(const MeshView& mesh) {
  const size_t vertices = mesh.positions.size();
  return first_bad_triangle(mesh, [&](size_t i) {
    const Triangle& t = mesh.triangles[i];
    return t[0] >= vertices || t[1] >= vertices || t[2] >= vertices;
  });
}

void check_length(const char* name, size_t length, const char* of, size_t expected) {
  if (length != 0 && length != expected)
    throw Error(ErrorCode::kInvalidArgument, std::string(name) + " has " + std::to_string(length) +
                                                 " elements, but the mesh has " +
                                                 std::to_string(expected) + " " + of);
}

}  // namespace

void check_streams(const MeshView& mesh) {
  const size_t vertices = mesh.positions.size();
  check_length("normals", mesh.normals.size(), "vertices", vertices);
  check_length("tangents", mesh.tangents.size(), "vertices", vertices);
  check_length("uvs", mesh.uvs.size(), "vertices", vertices);
  check_length("colors", mesh.colors.size(), "vertices", vertices);
  check_length("materials", mesh.materials.size(), "triangles", mesh.triangles.size());
}

void check_indices(const MeshView& mesh) {
  const size_t first = first_index_out_of_range(mesh);
  if (first == mesh.triangles.size()) return;
  uint32_t corner = 0;
  while (mesh.triangles[first][corner] < mesh.positions.size()) ++corner;
  reject(mesh, first, corner);
}

uint32_t first_invalid_corner(const MeshView& mesh, size_t triangle) {
  for (uint32_t corner = 0; corner < 3; ++corner) {
    const uint32_t vertex = mesh.triangles[triangle][corner];
    if (vertex >= mesh.positions.size() || !vertex_is_finite(mesh, vertex)) return corner;
  }
  return 3;
}

void validate(const MeshView& mesh, const BuildOptions& options) {
  check_streams(mesh);
  Progress progress(options);
  progress.report(0, "validating");
  size_t first = mesh.triangles.size();
  with_threads(options.threads, [&] {
    // Reading every vertex once is cheaper than once a corner, unless most are unused.
    const bool few_unused = mesh.positions.size() <= 3 * mesh.triangles.size();
    if (few_unused && every_vertex_is_finite(mesh))
      first = first_index_out_of_range(mesh);
    else
      first = first_bad_triangle(mesh, [&](size_t i) { return first_invalid_corner(mesh, i) < 3; });
  });
  if (first < mesh.triangles.size()) reject(mesh, first, first_invalid_corner(mesh, first));
  progress.report(1, "validating");
}

}  // namespace umbel
