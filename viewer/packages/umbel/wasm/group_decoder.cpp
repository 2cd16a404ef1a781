// The library's decoder of clusters as a module of WebAssembly: what src/decode/wasm_decoder.ts
// calls. It takes no imports. Damaged data end in a trap.
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <new>
#include <span>
#include <utility>
#include <vector>

#include "asset/codec/shared_vertices.hpp"
#include "asset/codec/twins.hpp"
#include "asset/codec/vertex_codec.hpp"

extern "C" std::byte __heap_base;  // by the linker: where free memory begins

namespace {

using namespace umbel;
using namespace umbel::asset;

// ---- memory: what the caller has reserved, then what one call allocates

constexpr size_t kPage = 65536, kAlignment = 16;

uintptr_t end_of_reserved = 0, top = 0;

uintptr_t aligned(uintptr_t address) { return (address + kAlignment - 1) & ~(kAlignment - 1); }

/// Of so many bytes. The memory grows as needed.
uintptr_t take(uintptr_t from, size_t bytes) {
  const uintptr_t begin = aligned(from), size = __builtin_wasm_memory_size(0) * kPage;
  if (bytes > UINT32_MAX - kAlignment - begin) __builtin_trap();
  top = begin + bytes;
  if (top > size && __builtin_wasm_memory_grow(0, (top - size + kPage - 1) / kPage) == SIZE_MAX)
    __builtin_trap();
  return begin;
}

// ---- the group that the caller describes, in words

class Words {
 public:
  explicit Words(const uint32_t* at) : at_(at) {}
  uint32_t next() { return *at_++; }

 private:
  const uint32_t* at_;
};

VertexFormat read_format(Words& in, uint32_t attributes) {
  std::vector<AttributeFormat> formats;
  for (uint32_t i = 0; i < attributes; ++i) {
    AttributeFormat f{};
    f.attribute = in.next();
    f.set = in.next();
    f.coding = static_cast<Coding>(in.next());
    f.bits = in.next();
    f.step = std::bit_cast<float>(in.next());
    f.components = static_cast<uint16_t>(in.next());
    f.is_smooth = static_cast<uint16_t>(in.next());
    formats.push_back(f);
  }
  return make_format(std::move(formats));
}

std::vector<ComponentRange> read_ranges(Words& in, uint32_t components) {
  std::vector<ComponentRange> ranges;
  for (uint32_t i = 0; i < components; ++i) {
    const auto lowest = static_cast<int32_t>(in.next());
    ranges.push_back({lowest, in.next()});
    if (ranges.back().bits > 32) __builtin_trap();
  }
  return ranges;
}

struct Cluster {
  uint32_t vertices, triangles, end;
};

std::vector<Cluster> read_clusters(Words& in, uint32_t count, uint32_t begin, uint32_t bytes) {
  std::vector<Cluster> clusters;
  for (uint32_t i = 0; i < count; ++i) {
    const uint32_t vertices = in.next(), triangles = in.next(), end = in.next();
    if (vertices > kMaxLocal || triangles > kMaxLocal || end < begin || end > bytes)
      __builtin_trap();
    clusters.push_back({vertices, triangles, end});
    begin = end;
  }
  return clusters;
}

}  // namespace

/// Room for so many bytes, which stays until the next call; its address.
extern "C" [[clang::export_name("reserve")]] void* reserve(size_t bytes) {
  const uintptr_t begin = take(reinterpret_cast<uintptr_t>(&__heap_base), bytes);
  end_of_reserved = top;
  return reinterpret_cast<void*>(begin);
}

/// Decodes all clusters of a group. `words`: the version of the file format; numbers of attributes,
/// components and clusters; where the first cluster's data begin in the chunk, and the chunk's
/// bytes; for each attribute its kind, set, coding, bits, step, components and whether it is
/// smooth; for each component its lowest value and bits; for each cluster its vertices, triangles,
/// and where its data end. Out: three vertices a triangle, counted from the group's first, and the
/// vertices' integers, a multiple of four for each.
extern "C" [[clang::export_name("decode")]] void decode(const uint32_t* words,
                                                        const std::byte* chunk, uint32_t* indices,
                                                        int32_t* rows) {
  top = end_of_reserved;
  Words in(words);
  const uint32_t version = in.next(), attributes = in.next(), component_count = in.next();
  const uint32_t cluster_count = in.next();
  uint32_t begin = in.next();
  const uint32_t bytes = in.next();
  const VertexFormat format = read_format(in, attributes);
  if (components(format) != component_count) __builtin_trap();
  const std::vector<ComponentRange> ranges = read_ranges(in, component_count);
  const std::vector<Cluster> clusters = read_clusters(in, cluster_count, begin, bytes);
  size_t vertices = 0;
  for (const Cluster& cluster : clusters) vertices += cluster.vertices;

  const std::span integers(rows, vertices * row_stride(format));
  GroupBorders borders(vertices);
  std::array<Predictors, kMaxLocal> predictors;
  std::array<uint32_t, kMaxLocal> equals, twins;
  std::array<uint8_t, size_t{3} * kMaxLocal> corners;
  uint32_t first = 0;
  for (const auto& [vertex_count, triangle_count, end] : clusters) {
    BitReader bits({chunk + begin, end - begin}, bytes - end);
    const auto triangles = std::span(corners).first(size_t{3} * triangle_count);
    const auto mine = std::span(predictors).first(vertex_count);
    decode_triangles(version, bits, triangles, mine, borders.add_cluster(vertex_count));
    borders.list_last();
    const auto equal = std::span(equals).first(vertex_count);
    decode_shared(bits, borders, equal);
    if (version == 3) {
      decode_vertices_3(format, mine, equal, ranges, bits, integers, first);
    } else {
      auto twin = std::span(twins).first(vertex_count);
      if (!decode_twins(bits, borders, equal, twin)) twin = {};
      decode_vertices(version, format, {mine, triangles}, {equal, twin}, ranges, bits, integers,
                      first);
    }
    bits.finish();
    for (const uint8_t corner : triangles) *indices++ = first + corner;
    begin = end;
    first += vertex_count;
  }
}

// ---- what the C++ library would bring, with much else

void* operator new(size_t bytes) { return reinterpret_cast<void*>(take(top, bytes)); }
void operator delete(void*) noexcept {}
void operator delete(void*, size_t) noexcept {}

// NOLINTNEXTLINE(cert-dcl58-cpp): the library lets programs replace it, which leaves out printf.
void std::__libcpp_verbose_abort(const char*, ...) noexcept { __builtin_trap(); }
extern "C" void* __cxa_allocate_exception(size_t) noexcept { __builtin_trap(); }
extern "C" void __cxa_throw(void*, void*, void (*)(void*)) { __builtin_trap(); }
