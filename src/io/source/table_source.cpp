#include "io/source/table_source.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <utility>

#include "base/bytes.hpp"
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

Vec3d cross(const Vec3d& a, const Vec3d& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
double dot(const Vec3d& a, const Vec3d& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

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
  }
  streams_.materials = layout_.has_materials;
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
  check(part.normals, 3, part.vertices, part);
  check(part.tangents, 4, part.vertices, part);
  check(part.uvs, 2, part.vertices, part);
  check(part.colors, part.colors.offsets.size() == 3 ? 3 : 4, part.vertices, part);
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
    if (from < to) append(layout_.parts[k], from - first_[k], to - first_[k], block);
  }
  return block;
}

// One step a stream.
void TableSource::append(const TablePart& part, uint64_t begin, uint64_t end,
                         TriangleBlock& block) const {
  Files files(layout_.files);
  const size_t base = block.positions.size(), first = block.triangles.size();
  const auto table = [&](const Column& c) -> const Table& { return layout_.tables[c.table]; };
  const auto rows = [&](const Column& c, uint64_t from, uint64_t to, auto& out) {
    gather(files[table(c).file], table(c), c, from, to, out);
  };
  std::vector<uint32_t> ids;
  if (part.indices.is_there()) {
    rows(part.indices, begin, end, ids);
    for (size_t i = 0; i < ids.size(); ++i)
      if (ids[i] >= part.vertices)
        throw Error(ErrorCode::kInvalidMesh,
                    part.name + ": triangle " + std::to_string(begin + i / 3) +
                        " has vertex index " + std::to_string(ids[i]) + ", of " +
                        std::to_string(part.vertices) + " there are");
  } else {
    ids.resize(3 * (end - begin));
    for (size_t i = 0; i < ids.size(); ++i) ids[i] = static_cast<uint32_t>(3 * begin + i);
  }
  std::vector<double> positions;
  std::vector<uint32_t> used;
  if (part.positions.offsets.size() == 9) {
    rows(part.positions, begin, end, positions);
    for (size_t i = 0; i < ids.size(); ++i) ids[i] = static_cast<uint32_t>(i);
  } else {
    used = number_vertices(ids);
    gather(files[table(part.positions).file], table(part.positions), part.positions, used,
           positions);
  }
  const size_t count = positions.size() / 3;
  for (size_t v = 0; v < count; ++v)
    block.positions.push_back({positions[3 * v], positions[3 * v + 1], positions[3 * v + 2]});
  for (size_t i = 0; i < ids.size(); i += 3)
    block.triangles.push_back({static_cast<uint32_t>(base + ids[i]),
                               static_cast<uint32_t>(base + ids[i + 1]),
                               static_cast<uint32_t>(base + ids[i + 2])});
  std::vector<float> values;
  const auto stream = [&](const Column& c, bool wanted, auto& out, auto missing, const auto& make) {
    if (!wanted) return;
    if (!c.is_there()) return out.resize(base + count, missing);
    values.clear();
    gather(files[table(c).file], table(c), c, std::span<const uint32_t>(used), values);
    const size_t width = c.offsets.size();
    for (size_t v = 0; v < count; ++v) out.push_back(make(values.data() + v * width, width));
  };
  stream(part.normals, streams_.normals, block.normals, Vec3{0, 0, 0},
         [](const float* p, size_t) { return unit_normal({p[0], p[1], p[2]}); });
  stream(part.tangents, streams_.tangents, block.tangents, Vec4{0, 0, 0, 1},
         [](const float* p, size_t) { return Vec4{p[0], p[1], p[2], p[3]}; });
  stream(part.uvs, streams_.uvs, block.uvs, Vec2{0, 0},
         [](const float* p, size_t) { return Vec2{p[0], p[1]}; });
  stream(part.colors, streams_.colors, block.colors, Vec4{1, 1, 1, 1},
         [](const float* p, size_t width) {
           return Vec4{p[0], p[1], p[2], width == 4 ? p[3] : 1.0f};
         });
  if (streams_.materials) {
    if (part.materials.is_there()) {
      rows(part.materials, begin, end, block.materials);
      for (size_t i = first; i < block.materials.size(); ++i) block.materials[i] += part.material;
    } else {
      block.materials.resize(block.triangles.size(), part.material);
    }
  }
  if (part.transform) transform(*part.transform, block, base, first);
  check_finite(block, part.name, begin, base, first);
}

}  // namespace umbel::io
