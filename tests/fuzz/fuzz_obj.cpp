// Fuzzes the reader of OBJ: any text is a mesh whose indices are its own, or is refused with a
// sentence, and blocks of a few bytes give the same as a single one.
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <span>
#include <string>

#include "io/obj.hpp"

namespace {

using umbel::io::ObjMesh;

[[noreturn]] void fail(const char* what) {
  std::fprintf(stderr, "fuzz_obj: %s\n", what);
  std::abort();
}

struct Result {
  ObjMesh mesh;
  std::string refusal;
};

Result read(std::span<const std::byte> text, size_t block_bytes) {
  Result result;
  try {
    result.mesh = umbel::io::read_obj(umbel::io::ByteSource(text), "a.obj", block_bytes);
  } catch (const umbel::Error& error) {
    result.refusal = error.what();
    if (result.refusal.find("a.obj") == std::string::npos) fail("a refusal names no file");
  }
  return result;
}

void check(const ObjMesh& mesh) {
  bool is_whole = true;
  for (const umbel::Triangle& triangle : mesh.triangles)
    for (const uint32_t v : triangle) {
      is_whole = is_whole && v != umbel::kNone;
      if (v != umbel::kNone && v >= mesh.positions.size()) fail("an index is out of range");
    }
  if (is_whole != mesh.fault.empty()) fail("a missing vertex is not named");
  const size_t n = mesh.positions.size();
  const auto fits = [&](const auto& rows) { return rows.empty() || rows.size() == n; };
  if (!fits(mesh.uvs) || !fits(mesh.normals) || !fits(mesh.colors)) fail("rows are missing");
  if (!mesh.materials.empty() && mesh.materials.size() != mesh.triangles.size())
    fail("materials are missing");
  for (const uint32_t m : mesh.materials)
    if (m != umbel::kNone && m >= mesh.material_names.size()) fail("a material is out of range");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  if (size == 0) return 0;
  const std::span text(reinterpret_cast<const std::byte*>(data + 1), size - 1);
  const Result whole = read(text, size_t{1} << 20);
  check(whole.mesh);
  const Result parts = read(text, size_t{1} + data[0] % 64);
  if (parts.refusal != whole.refusal) fail("blocks give another refusal");
  if (parts.mesh.triangles != whole.mesh.triangles || parts.mesh.notes != whole.mesh.notes ||
      parts.mesh.fault != whole.mesh.fault || parts.mesh.uvs != whole.mesh.uvs ||
      parts.mesh.material_names != whole.mesh.material_names ||
      parts.mesh.positions.size() != whole.mesh.positions.size())
    fail("blocks give another mesh");
  return 0;
}
