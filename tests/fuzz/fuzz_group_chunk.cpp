// Fuzzes the decoder of a group's chunk, and the coding of triangles there and back. Any bytes must
// decode, or be refused with a sentence; any triangles must come back as they were, but for the
// order and the first corner, which the traversal chooses.
#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <tuple>
#include <vector>

#include "asset/codec/connectivity.hpp"
#include "asset/file/format.hpp"
#include "asset/file/group_chunk.hpp"
#include "umbel/umbel.hpp"

namespace {

namespace asset = umbel::asset;
using Triangle = std::array<uint8_t, 3>;

[[noreturn]] void fail(const std::string& what) {
  std::fprintf(stderr, "fuzz_group_chunk: %s\n", what.c_str());
  std::abort();
}

/// One of some formats that cover every coding.
asset::VertexFormat format_of(uint8_t choice) {
  using asset::Coding;
  std::vector<asset::AttributeFormat> attributes{
      {asset::kPositions, choice & 1 ? Coding::kGrid : Coding::kFloats, 0, 0.5f}};
  if (choice & 2) attributes.push_back({asset::kNormals, Coding::kOctahedral, 10, 0});
  if ((choice & 6) == 6) attributes.push_back({asset::kTangents, Coding::kAngle, 8, 0});
  if (choice & 8) attributes.push_back({asset::kUvs, Coding::kGrid, 0, 0x1p-14f});
  if (choice & 32) attributes.push_back({asset::kUvs, Coding::kFloats, 0, 0, 1});
  if (choice & 16) attributes.push_back({asset::kColors, Coding::kSrgb, 8, 0});
  if (choice & 64) attributes.push_back({asset::kJoints, Coding::kGrid, 0, 1});
  if (choice & 64) attributes.push_back({asset::kWeights, Coding::kGrid, 0, 0x1p-14f});
  if (choice & 128) attributes.push_back({1u << 20, Coding::kFloats, 0, 0, 0, 3});  // unknown
  return asset::make_format(attributes);
}

void decode_clusters(const asset::VertexFormat& format, const asset::ChunkTables& tables,
                     const std::vector<std::byte>& chunk) {
  const auto decoded = asset::decode_clusters(format, tables, chunk, tables.clusters.size());
  for (size_t c = 0; c < decoded.size(); ++c) {
    if (decoded[c].positions.size() != tables.clusters[c].vertex_count)
      fail("vertices are missing");
    for (const uint8_t v : decoded[c].triangles)
      if (v >= tables.clusters[c].vertex_count) fail("a triangle has a vertex that is not there");
  }
}

void decode_any(const uint8_t* data, size_t size) {
  const asset::VertexFormat format = format_of(data[0]);
  const uint32_t clusters = 1 + data[1] % 4, references = data[1] / 64;
  const uint32_t version = data[1] & 4 ? 3 : 4;
  std::vector<std::byte> chunk(size - 2);
  std::transform(data + 2, data + size, chunk.begin(), [](uint8_t b) { return std::byte{b}; });
  const umbel::Aabb bounds{{0, 0, 0}, {1, 1, 1}};
  if (data[1] & 8) {
    decode_clusters(
        format, asset::decode_tables(format, bounds, clusters, references, chunk, version), chunk);
    return;
  }
  // Hardly any input would get past the tables: here they are right, of a few bytes.
  const size_t begin = 2 * size_t{clusters} + asset::components(format);
  if (chunk.size() <= begin) return;
  asset::ChunkTables tables{{}, {}, {}, {}, static_cast<uint32_t>(begin), version};
  for (uint32_t c = 0; c < asset::components(format); ++c) {
    const auto byte = static_cast<uint32_t>(chunk[c]);
    tables.ranges.push_back({static_cast<int32_t>(byte << byte % 24), byte % 33});
  }
  for (uint32_t c = 0; c < clusters; ++c) {
    const size_t at = asset::components(format) + 2 * size_t{c};
    tables.ends.push_back(
        static_cast<uint32_t>(begin + (chunk.size() - begin) * (c + 1) / clusters));
    tables.clusters.push_back({umbel::kNone, umbel::kNone, 0, static_cast<uint32_t>(chunk[at]) + 1,
                               static_cast<uint32_t>(chunk[at + 1]) + 1, bounds});
  }
  decode_clusters(format, tables, chunk);
}

std::vector<Triangle> sorted(std::vector<Triangle> triangles) {
  for (auto& [a, b, c] : triangles)
    std::tie(a, b, c) = std::min({std::tuple(a, b, c), std::tuple(b, c, a), std::tuple(c, a, b)});
  std::sort(triangles.begin(), triangles.end());
  return triangles;
}

void there_and_back(const uint8_t* data, size_t size) {
  const uint32_t vertices = 1 + data[0];
  const size_t count = std::min<size_t>((size - 1) / 3, asset::kMaxLocal);
  std::vector<uint8_t> given(3 * count);
  for (size_t i = 0; i < given.size(); ++i) given[i] = static_cast<uint8_t>(data[1 + i] % vertices);
  std::vector<std::byte> bytes;
  umbel::BitWriter out(bytes);
  const asset::Traversal traversal = asset::encode_triangles(given, vertices, {}, out);
  out.finish();
  std::vector<uint8_t> read(given.size());
  std::vector<asset::Predictors> predictors(vertices);
  std::array<uint32_t, asset::kMaxLocal> next, previous;
  umbel::BitReader in(bytes);
  asset::decode_triangles(asset::kVersionMajor, in, read, predictors,
                          {next.data(), previous.data(), 0});
  in.finish();
  std::vector<Triangle> before(count), after(count);
  for (size_t i = 0; i < given.size(); ++i) {
    before[i / 3][i % 3] = given[i];
    after[i / 3][i % 3] = traversal.vertices[read[i]];
  }
  if (sorted(before) != sorted(after)) fail("triangles did not come back");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  if (size < 4) return 0;
  there_and_back(data + 1, size - 1);
  try {
    decode_any(data, size);
  } catch (const umbel::Error& error) {
    if (error.code() != umbel::ErrorCode::kCorrupt) fail(error.what());
  }
  return 0;
}
