// Rejects meshes that later stages could not make sense of, naming the first offender: the
// lowest triangle, its first bad corner, that corner's index or value. Only vertices that
// triangles use are judged.
#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <cmath>

#include "base/first_where.hpp"
#include "base/parallel.hpp"
#include "base/printed.hpp"
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

// A joint or a material is a whole number that floats can count to.
bool is_whole(ExtraKind kind) { return kind == ExtraKind::kJoints || kind == ExtraKind::kMaterial; }
bool is_good_extra(ExtraKind kind, float value) {
  if (!all_finite(value)) return false;
  if (!is_whole(kind)) return true;
  return value >= 0.0f && value <= 0x1p24f && value == std::floor(value);
}

// The value at fault of a vertex, or null.
const float* bad_extra(const MeshView& mesh, size_t vertex) {
  const float* value = mesh.extra_values.data() + vertex * extra_width(mesh.extras);
  for (const Extra& extra : mesh.extras)
    for (uint32_t k = 0; k < extra_width(extra.kind); ++k, ++value)
      if (!is_good_extra(extra.kind, *value)) return value;
  return nullptr;
}

bool all_extras_are_good(const MeshView& mesh) {
  if (!all_finite(mesh.extra_values)) return false;
  if (std::ranges::none_of(mesh.extras, is_whole, &Extra::kind)) return true;
  std::atomic<bool> good{true};
  parallel_chunks(mesh.positions.size(), size_t{1} << 16, [&](size_t begin, size_t end) {
    for (size_t v = begin; v < end; ++v)
      if (bad_extra(mesh, v)) return good.store(false, std::memory_order_relaxed);
  });
  return good;
}

bool every_vertex_is_finite(const MeshView& mesh) {
  return all_extras_are_good(mesh) && all_finite(mesh.positions) && all_finite(mesh.normals) &&
         all_finite(mesh.tangents) && all_finite(mesh.uvs) && all_finite(mesh.colors);
}

template <typename Vector>
bool bad_in(std::span<const Vector> stream, uint32_t vertex) {
  return !stream.empty() && !all_finite(stream[vertex]);
}

bool vertex_is_finite(const MeshView& mesh, uint32_t vertex) {
  return !(bad_extra(mesh, vertex) || bad_in(mesh.positions, vertex) ||
           bad_in(mesh.normals, vertex) || bad_in(mesh.tangents, vertex) ||
           bad_in(mesh.uvs, vertex) || bad_in(mesh.colors, vertex));
}

std::string offending_value(const MeshView& mesh, uint32_t vertex) {
  const auto sentence = [&](const char* name, const auto& stream) {
    return std::string("the ") + name + " of vertex " + std::to_string(vertex) + " is " +
           printed_vector(stream[vertex]) + ", which is not finite";
  };
  if (bad_in(mesh.positions, vertex)) return sentence("position", mesh.positions);
  if (bad_in(mesh.normals, vertex)) return sentence("normal", mesh.normals);
  if (bad_in(mesh.tangents, vertex)) return sentence("tangent", mesh.tangents);
  if (bad_in(mesh.uvs, vertex)) return sentence("texture coordinate", mesh.uvs);
  if (bad_in(mesh.colors, vertex)) return sentence("colour", mesh.colors);
  const float value = *bad_extra(mesh, vertex);
  return "a further attribute of vertex " + std::to_string(vertex) + " has the value " +
         printed_vector(std::array<float, 1>{value}) + ", which " +
         (all_finite(std::array<float, 1>{value}) ? "is not the number of a joint"
                                                  : "is not finite");
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

size_t first_index_out_of_range(const MeshView& mesh) {
  const size_t vertices = mesh.positions.size();
  return first_where(mesh.triangles.size(), kTriangleChunk, [&](size_t i) {
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

void check_extras(const MeshView& mesh) {
  const auto reject = [](const std::string& what) {
    throw Error(ErrorCode::kInvalidArgument, what);
  };
  for (size_t i = 0; i < mesh.extras.size(); ++i) {
    const Extra& extra = mesh.extras[i];
    const std::string name = "extras[" + std::to_string(i) + "]";
    if (extra_width(extra.kind) == 0)
      reject(name + " has the kind " + std::to_string(static_cast<uint32_t>(extra.kind)) +
             ", which is none");
    const bool first_uvs = extra.kind == ExtraKind::kUvs && extra.set == 0;
    if (first_uvs || extra.set > 255)
      reject(name + " has the set " + std::to_string(extra.set) + ", must be in [" +
             (extra.kind == ExtraKind::kUvs ? "1" : "0") + ", 255]");
    if (i == 0) continue;
    const Extra& before = mesh.extras[i - 1];
    if (before.kind > extra.kind || (before.kind == extra.kind && before.set >= extra.set))
      reject(name + " must come before the one before it, by kind and set");
  }
  const uint32_t width = extra_width(mesh.extras);
  if (width > kMostExtraValues)
    reject("the extras have " + std::to_string(width) + " values a vertex, at most " +
           std::to_string(kMostExtraValues) + " are possible");
  if (mesh.extra_values.size() != mesh.positions.size() * width)
    reject("extra_values has " + std::to_string(mesh.extra_values.size()) +
           " elements, but the extras of " + std::to_string(mesh.positions.size()) +
           " vertices have " + std::to_string(mesh.positions.size() * width));
}

}  // namespace

uint32_t extra_width(ExtraKind kind) {
  switch (kind) {
    case ExtraKind::kUvs:
      return 2;
    case ExtraKind::kJoints:
    case ExtraKind::kWeights:
      return 4;
    case ExtraKind::kMaterial:
      return 1;
  }
  return 0;
}

uint32_t extra_width(std::span<const Extra> extras) {
  uint32_t width = 0;
  for (const Extra& extra : extras) width += extra_width(extra.kind);
  return width;
}

void check_streams(const MeshView& mesh) {
  const size_t vertices = mesh.positions.size();
  check_length("normals", mesh.normals.size(), "vertices", vertices);
  check_length("tangents", mesh.tangents.size(), "vertices", vertices);
  check_length("uvs", mesh.uvs.size(), "vertices", vertices);
  check_length("colors", mesh.colors.size(), "vertices", vertices);
  check_length("materials", mesh.materials.size(), "triangles", mesh.triangles.size());
  check_extras(mesh);
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
      first = first_where(mesh.triangles.size(), kTriangleChunk,
                          [&](size_t i) { return first_invalid_corner(mesh, i) < 3; });
  });
  if (first < mesh.triangles.size()) reject(mesh, first, first_invalid_corner(mesh, first));
  progress.report(1, "validating");
}

}  // namespace umbel
