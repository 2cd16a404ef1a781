#include "io/source/table_source.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <span>
#include <utility>

#include "base/bytes.hpp"
#include "base/hash.hpp"
#include "base/interner.hpp"
#include "base/math.hpp"
#include "base/srgb.hpp"
#include "io/source/gather.hpp"
#include "io/source/vertex_numbers.hpp"

namespace umbel::io {
namespace {

/// Files that are opened when they are first read.
class Files {
 public:
  explicit Files(const std::vector<std::filesystem::path>& paths) : paths_(paths) {}
  const InputFile& operator[](uint32_t file) {
    auto& opened = open_[file];
    if (!opened) opened = std::make_unique<InputFile>(paths_[file]);
    return *opened;
  }

 private:
  const std::vector<std::filesystem::path>& paths_;
  std::map<uint32_t, std::unique_ptr<InputFile>> open_;
};

Vec3 normalized(Vec3d v) {
  const double largest = std::max({std::fabs(v.x), std::fabs(v.y), std::fabs(v.z)});
  v = {v.x / largest, v.y / largest, v.z / largest};
  const double length = std::sqrt(dot(v, v));
  v = {v.x / length, v.y / length, v.z / length};
  if (!std::isfinite(v.x) || !std::isfinite(v.y) || !std::isfinite(v.z)) return {0, 0, 0};
  return {static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z)};
}

Vec3 unit_normal(const Vec3& n) {
  const Vec3d v{n.x, n.y, n.z};
  const double length = std::sqrt(dot(v, v));
  const bool wrong = std::fabs(length - 1.0) > 0.01 && length > 0 && std::isfinite(length);
  return wrong ? normalized(v) : n;
}

/// Moves the vertices of one part, from `vertex` and `triangle` on.
void transform(const std::array<double, 12>& m, TriangleBlock& block, size_t vertex,
               size_t triangle) {
  const Vec3d rows[] = {{m[0], m[1], m[2]}, {m[4], m[5], m[6]}, {m[8], m[9], m[10]}};
  // Cofactors are the inverse transpose times the determinant, and exist where that is zero.
  const Vec3d cofactors[] = {cross(rows[1], rows[2]), cross(rows[2], rows[0]),
                             cross(rows[0], rows[1])};
  const bool mirrored = dot(rows[0], cofactors[0]) < 0;
  for (size_t v = vertex; v < block.positions.size(); ++v) {
    Vec3d& p = block.positions[v];
    p = {dot(p, rows[0]) + m[3], dot(p, rows[1]) + m[7], dot(p, rows[2]) + m[11]};
  }
  const double sign = mirrored ? -1.0 : 1.0;
  for (size_t v = vertex; v < block.normals.size(); ++v) {
    const Vec3d n{block.normals[v].x, block.normals[v].y, block.normals[v].z};
    block.normals[v] = normalized(
        {dot(n, cofactors[0]) * sign, dot(n, cofactors[1]) * sign, dot(n, cofactors[2]) * sign});
  }
  for (size_t v = vertex; v < block.tangents.size(); ++v) {
    Vec4& t = block.tangents[v];
    const Vec3d old{t.x, t.y, t.z};
    const Vec3 along = normalized({dot(old, rows[0]), dot(old, rows[1]), dot(old, rows[2])});
    t = {along.x, along.y, along.z, mirrored ? -t.w : t.w};
  }
  if (!mirrored) return;
  for (size_t i = triangle; i < block.triangles.size(); ++i)
    std::swap(block.triangles[i][1], block.triangles[i][2]);
}

/// Before values are appended. Where they are few, as those of one of many small parts, the next
/// ones get room too.
template <typename Value>
void make_room(std::vector<Value>& values, size_t more) {
  const size_t needed = values.size() + more;
  if (needed > values.capacity()) values.reserve(std::max(needed, 2 * values.capacity()));
}

/// The numbers of a corner's rows: position, texture coordinate, normal.
using CornerKey = std::array<uint32_t, 3>;
struct CornerHash {
  uint64_t operator()(const CornerKey& key) const {
    return mix64(mix64(key[0] | uint64_t{key[1]} << 32) ^ key[2]);
  }
};

/// Reads triangles of one part.
class PartReader {
 public:
  PartReader(const TableLayout& layout, const TablePart& part, const SourceStreams& streams)
      : layout_(layout), part_(part), streams_(streams), files_(layout.files) {}

  void append(uint64_t begin, uint64_t end, TriangleBlock& block) {
    const size_t vertex = block.positions.size(), triangle = block.triangles.size();
    std::vector<uint32_t> corners;
    if (part_.positions.offsets.size() == 9) {
      std::vector<double> positions;
      rows(part_.positions, begin, end, positions);
      add_positions(positions, block);
      corners.resize(3 * (end - begin));
      for (size_t i = 0; i < corners.size(); ++i) corners[i] = static_cast<uint32_t>(i);
    } else {
      corners = number_corners(begin, end);
      std::vector<double> positions;
      gather_rows(part_.positions, vertices_, positions);
      add_positions(positions, block);
    }
    make_room(block.triangles, corners.size() / 3);
    for (size_t i = 0; i < corners.size(); i += 3)
      block.triangles.push_back({static_cast<uint32_t>(vertex + corners[i]),
                                 static_cast<uint32_t>(vertex + corners[i + 1]),
                                 static_cast<uint32_t>(vertex + corners[i + 2])});
    add_streams(block);
    if (streams_.materials) add_materials(begin, end, block, triangle);
    if (part_.transform) transform(*part_.transform, block, vertex, triangle);
    check_finite(block, part_.name, begin, vertex, triangle);
  }

 private:
  const Table& table(const Column& column) const { return layout_.tables[column.table]; }

  template <typename Out>
  void rows(const Column& column, uint64_t begin, uint64_t end, std::vector<Out>& out) {
    gather(files_[table(column).file], table(column), column, begin, end, out);
  }

  /// Values of the rows `ids`, which may be in any order; zeros for kNone.
  template <typename Out>
  void gather_rows(const Column& column, std::span<const uint32_t> ids, std::vector<Out>& out) {
    const InputFile& file = files_[table(column).file];
    if (std::is_sorted(ids.begin(), ids.end()) && (ids.empty() || ids.back() != kNone))
      return gather(file, table(column), column, ids, out);
    std::vector<uint32_t> numbers;
    for (uint32_t id : ids)
      if (id != kNone) numbers.push_back(id);
    const std::vector<uint32_t> used = number_vertices(numbers);
    std::vector<Out> values;
    gather(file, table(column), column, std::span<const uint32_t>(used), values);
    const size_t width = column.offsets.size();
    size_t at = 0;
    for (uint32_t id : ids) {
      if (id == kNone) {
        out.insert(out.end(), width, Out{});
      } else {
        const auto from = values.begin() + static_cast<ptrdiff_t>(numbers[at++] * width);
        out.insert(out.end(), from, from + static_cast<ptrdiff_t>(width));
      }
    }
  }

  std::vector<uint32_t> indices(const Column& column, uint64_t begin, uint64_t end, uint64_t count,
                                bool may_miss) {
    std::vector<uint32_t> ids;
    rows(column, begin, end, ids);
    for (size_t i = 0; i < ids.size(); ++i)
      if (ids[i] >= count && !(may_miss && ids[i] == kNone))
        throw Error(ErrorCode::kInvalidMesh,
                    part_.name + ": triangle " + std::to_string(begin + i / 3) +
                        " has vertex index " + index_text(ids[i], column.type) + ", of " +
                        std::to_string(count) + " there are");
    return ids;
  }

  /// The vertices of the block that corners are, and for each of those its rows.
  std::vector<uint32_t> number_corners(uint64_t begin, uint64_t end) {
    std::vector<uint32_t> ids;
    if (part_.indices.is_there()) {
      ids = indices(part_.indices, begin, end, part_.vertices, false);
    } else {
      ids.resize(3 * (end - begin));
      for (size_t i = 0; i < ids.size(); ++i) ids[i] = static_cast<uint32_t>(3 * begin + i);
    }
    const bool own_uvs = part_.uv_indices.is_there(), own_normals = part_.normal_indices.is_there();
    if (!own_uvs && !own_normals) {
      vertices_ = number_vertices(ids);
      uv_rows_ = normal_rows_ = vertices_;
      return ids;
    }
    std::vector<uint32_t> uvs, normals;
    if (own_uvs) uvs = indices(part_.uv_indices, begin, end, table(part_.uvs).rows, true);
    if (own_normals)
      normals = indices(part_.normal_indices, begin, end, table(part_.normals).rows, true);
    Interner<CornerKey, CornerHash> known;
    for (size_t i = 0; i < ids.size(); ++i)
      ids[i] = known.insert({ids[i], own_uvs ? uvs[i] : ids[i], own_normals ? normals[i] : ids[i]})
                   .first;
    for (const CornerKey& key : known.keys()) {
      vertices_.push_back(key[0]);
      uv_rows_.push_back(key[1]);
      normal_rows_.push_back(key[2]);
    }
    return ids;
  }

  static void add_positions(const std::vector<double>& values, TriangleBlock& block) {
    make_room(block.positions, values.size() / 3);
    for (size_t v = 0; v < values.size(); v += 3)
      block.positions.push_back({values[v], values[v + 1], values[v + 2]});
  }

  /// Appends a stream so that it is as long as the positions.
  template <typename Value, typename Make>
  void add_stream(const Column& column, std::span<const uint32_t> ids, TriangleBlock& block,
                  std::vector<Value>& out, Value missing, const Make& make) {
    if (!column.is_there()) return out.resize(block.positions.size(), missing);
    std::vector<float> values;
    gather_rows(column, ids, values);
    const size_t width = column.offsets.size();
    make_room(out, values.size() / width);
    for (size_t v = 0; v < values.size(); v += width) out.push_back(make(values.data() + v));
  }

  void add_streams(TriangleBlock& block) {
    if (streams_.normals)
      add_stream(part_.normals, normal_rows_, block, block.normals, Vec3{0, 0, 0},
                 [](const float* p) { return unit_normal({p[0], p[1], p[2]}); });
    if (streams_.tangents)
      add_stream(part_.tangents, vertices_, block, block.tangents, Vec4{0, 0, 0, 1},
                 [](const float* p) { return Vec4{p[0], p[1], p[2], p[3]}; });
    if (streams_.uvs)
      add_stream(part_.uvs, uv_rows_, block, block.uvs, Vec2{0, 0},
                 [](const float* p) { return Vec2{p[0], p[1]}; });
    if (!streams_.extras.empty()) add_extras(block);
    if (!streams_.colors) return;
    const bool has_alpha = part_.colors.offsets.size() == 4;
    const auto linear = [&](float value) {
      const float color = fraction_of(value, part_.color_scale.color);
      return part_.are_colors_srgb ? from_srgb(color) : color;
    };
    add_stream(part_.colors, vertices_, block, block.colors, Vec4{1, 1, 1, 1}, [&](const float* p) {
      const float alpha = has_alpha ? fraction_of(p[3], part_.color_scale.alpha) : 1.0f;
      return Vec4{linear(p[0]), linear(p[1]), linear(p[2]), alpha};
    });
  }

  // Of the block's vertices that are new: the values of one extra after the other.
  void add_extras(TriangleBlock& block) {
    const size_t width = extra_width(streams_.extras);
    const size_t base = block.extra_values.size();
    block.extra_values.resize(block.positions.size() * width, 0.0f);
    const std::span<float> rows = std::span(block.extra_values).subspan(base);
    size_t at = 0, first_joint = 0, first_weight = 0;
    for (const Extra& extra : streams_.extras) {
      if (extra.kind == ExtraKind::kJoints && extra.set == 0) first_joint = at;
      if (extra.kind == ExtraKind::kWeights && extra.set == 0) first_weight = at;
      const size_t own = extra_width(extra.kind);
      for (const ExtraColumn& given : part_.extras) {
        if (given.extra != extra) continue;
        std::vector<float> values;
        gather_rows(given.column, vertices_, values);
        for (size_t v = 0; v * own < values.size(); ++v)
          std::copy_n(values.begin() + static_cast<ptrdiff_t>(v * own), own,
                      rows.begin() + static_cast<ptrdiff_t>(v * width + at));
      }
      at += own;
    }
    if (first_weight == 0) return;
    const size_t joints = first_weight - first_joint;
    for (size_t row = 0; row < rows.size(); row += width)
      for (size_t k = 0; k < joints; ++k)
        if (rows[row + first_weight + k] == 0) rows[row + first_joint + k] = 0;
  }

  void add_materials(uint64_t begin, uint64_t end, TriangleBlock& block, size_t triangle) {
    if (!part_.materials.is_there())
      return block.materials.resize(block.triangles.size(), part_.material);
    rows(part_.materials, begin, end, block.materials);
    for (size_t i = triangle; i < block.materials.size(); ++i) {
      uint32_t& material = block.materials[i];
      material = material == kNone ? part_.default_material : number_of(material);
    }
  }

  uint32_t number_of(uint32_t material) const {
    const std::vector<uint32_t>& numbers = part_.material_numbers;
    return material < numbers.size() ? numbers[material] : material;
  }

  const TableLayout& layout_;
  const TablePart& part_;
  const SourceStreams& streams_;
  Files files_;
  std::vector<uint32_t> vertices_, uv_rows_, normal_rows_;  // rows of each vertex of the block
};

[[noreturn]] void refuse(const TablePart& part, const std::string& what) {
  throw Error(ErrorCode::kInvalidArgument, part.name + ": " + what);
}

}  // namespace

TableSource::TableSource(TableLayout layout) : layout_(std::move(layout)) {
  std::vector<uint64_t> sizes(layout_.files.size());
  for (size_t k = 0; k < sizes.size(); ++k) sizes[k] = InputFile(layout_.files[k]).size();
  for (const Table& table : layout_.tables) {
    if (table.file >= sizes.size() || table.stride == 0)
      throw Error(ErrorCode::kInvalidArgument, "a table is of no file, or has no columns");
    if (table.offset > sizes[table.file] ||
        (table.rows > 0 && (table.rows - 1) > (sizes[table.file] - table.offset) / table.stride))
      corrupt(layout_.files[table.file].string() + " is cut short: it should have " +
              std::to_string(table.rows) + " rows of " + std::to_string(table.stride) +
              " bytes from byte " + std::to_string(table.offset) + " on");
  }
  first_.push_back(0);
  for (TablePart& part : layout_.parts) {
    check(part);
    first_.push_back(first_.back() + part.triangles);
    streams_.normals |= part.normals.is_there();
    streams_.tangents |= part.tangents.is_there();
    streams_.uvs |= part.uvs.is_there();
    streams_.colors |= part.colors.is_there();
    for (const ExtraColumn& given : part.extras) streams_.extras.push_back(given.extra);
  }
  find_extras();
  streams_.materials = layout_.has_materials;
}

// Those of all parts, each once, as MeshView has them.
void TableSource::find_extras() {
  std::vector<Extra>& extras = streams_.extras;
  const auto key = [](const Extra& e) { return std::pair(e.kind, e.set); };
  std::ranges::sort(extras, {}, key);
  extras.erase(std::unique(extras.begin(), extras.end()), extras.end());
  const auto count = [&](ExtraKind kind) { return std::ranges::count(extras, kind, &Extra::kind); };
  if (count(ExtraKind::kJoints) != count(ExtraKind::kWeights))
    throw Error(ErrorCode::kInvalidArgument, "joints and weights belong together");
  if (extra_width(extras) > kMostExtraValues)
    throw Error(ErrorCode::kUnsupported, "vertices have " + std::to_string(extra_width(extras)) +
                                             " further values, more than " +
                                             std::to_string(kMostExtraValues));
}

void TableSource::check(const Column& column, size_t width, uint64_t rows,
                        const TablePart& part) const {
  if (!column.is_there()) return;
  if (column.table >= layout_.tables.size() || column.offsets.size() != width)
    refuse(part, "a column has no table, or not " + std::to_string(width) + " values");
  const Table& table = layout_.tables[column.table];
  const uint64_t size = InputFile(layout_.files[table.file]).size();
  if (table.rows < rows ||
      (rows > 0 && table.offset + (rows - 1) * table.stride + column.end() > size))
    corrupt(part.name + " is cut short: " + std::to_string(rows) + " rows are needed");
}

void TableSource::check(TablePart& part) const {
  const size_t width = part.positions.offsets.size();
  if (!part.positions.is_there() || (width != 3 && width != 9) ||
      part.positions.table >= layout_.tables.size())
    refuse(part, "there are no positions");
  part.vertices = layout_.tables[part.positions.table].rows * (width / 3);
  if (part.vertices >= kNone)
    throw Error(ErrorCode::kUnsupported, part.name + " has " + std::to_string(part.vertices) +
                                             " vertices, more than 32-bit indices can number");
  if (width == 9 && part.indices.is_there()) refuse(part, "corners have indices");
  if (!part.indices.is_there()) part.triangles = part.vertices / 3;
  check(part.positions, width, part.vertices / (width / 3), part);
  check(part.tangents, 4, part.vertices, part);
  const auto needed = [&](const Column& stream, const Column& own) {
    return own.is_there() && stream.is_there() && stream.table < layout_.tables.size()
               ? layout_.tables[stream.table].rows
               : part.vertices;
  };
  check(part.normals, 3, needed(part.normals, part.normal_indices), part);
  check(part.uvs, 2, needed(part.uvs, part.uv_indices), part);
  check(part.uv_indices, 3, part.triangles, part);
  check(part.normal_indices, 3, part.triangles, part);
  if ((part.uv_indices.is_there() && !part.uvs.is_there()) ||
      (part.normal_indices.is_there() && !part.normals.is_there()))
    refuse(part, "a stream has indices and no values");
  check(part.colors, part.colors.offsets.size() == 3 ? 3 : 4, part.vertices, part);
  for (const ExtraColumn& given : part.extras) {
    if (width == 9) refuse(part, "corners have further values");
    check(given.column, extra_width(given.extra.kind), part.vertices, part);
  }
  check(part.indices, 3, part.triangles, part);
  check(part.materials, 1, part.triangles, part);
}

TriangleBlock TableSource::read(uint64_t begin, uint64_t end) const {
  if (begin > end || end > triangles())
    throw Error(ErrorCode::kInvalidArgument, "triangles [" + std::to_string(begin) + ", " +
                                                 std::to_string(end) + ") are not in a source of " +
                                                 std::to_string(triangles()));
  TriangleBlock block;
  block.first = begin;
  size_t k =
      static_cast<size_t>(std::upper_bound(first_.begin(), first_.end(), begin) - first_.begin()) -
      1;
  for (; k < layout_.parts.size() && first_[k] < end; ++k) {
    const uint64_t from = std::max(begin, first_[k]), to = std::min(end, first_[k + 1]);
    if (from < to)
      PartReader(layout_, layout_.parts[k], streams_)
          .append(from - first_[k], to - first_[k], block);
  }
  return block;
}

std::vector<uint32_t> TableSource::files(uint64_t begin, uint64_t end) const {
  std::vector<uint32_t> files;
  for (size_t k = 0; k < layout_.parts.size(); ++k) {
    if (std::max(begin, first_[k]) >= std::min(end, first_[k + 1])) continue;
    const TablePart& part = layout_.parts[k];
    for (const Column* column :
         {&part.positions, &part.normals, &part.tangents, &part.uvs, &part.colors, &part.indices,
          &part.uv_indices, &part.normal_indices, &part.materials})
      if (column->is_there()) files.push_back(layout_.tables[column->table].file);
    for (const auto& extra : part.extras) files.push_back(layout_.tables[extra.column.table].file);
  }
  std::ranges::sort(files);
  files.erase(std::unique(files.begin(), files.end()), files.end());
  return files;
}

}  // namespace umbel::io
