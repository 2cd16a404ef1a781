#include "io/source/obj_tables.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <optional>
#include <span>
#include <unordered_map>

#include "base/bytes.hpp"
#include "base/file.hpp"
#include "io/obj.hpp"
#include "io/obj_block.hpp"
#include "io/obj_join.hpp"

namespace umbel::io {
namespace {

/// Rows of 32-bit words, or of 64-bit ones, in a file that is made with the first of them.
class RowFile {
 public:
  explicit RowFile(std::filesystem::path path) : path_(std::move(path)) {}

  bool is_there() const { return file_.has_value(); }
  uint64_t words() const { return words_; }
  const std::filesystem::path& path() const { return path_; }

  template <typename Value>
  void add(Value value) {
    using Word = std::conditional_t<sizeof(Value) == 8, uint64_t, uint32_t>;
    const auto bytes = std::bit_cast<std::array<std::byte, sizeof(Value)>>(
        little_endian(std::bit_cast<Word>(value)));
    buffer_.insert(buffer_.end(), bytes.begin(), bytes.end());
    ++words_;
    if (buffer_.size() >= kBuffer) flush();
  }
  /// So many of a value, for what stands before the first of its kind.
  template <typename Value>
  void fill(uint64_t count, Value value) {
    for (uint64_t k = 0; k < count; ++k) add(value);
  }
  void open() {
    if (!file_) file_.emplace(path_);
  }
  void commit() {
    flush();
    if (file_) file_->commit_unflushed();
  }

 private:
  static constexpr size_t kBuffer = size_t{1} << 20;

  void flush() {
    if (buffer_.empty()) return;
    open();
    file_->write(written_, buffer_);
    written_ += buffer_.size();
    buffer_.clear();
  }

  std::filesystem::path path_;
  std::optional<OutputFile> file_;
  std::vector<std::byte> buffer_;
  uint64_t words_ = 0, written_ = 0;
};

std::filesystem::path with_suffix(const std::filesystem::path& prefix, const char* suffix) {
  std::filesystem::path path = prefix;
  return path += suffix;
}

class Writer final : public ObjSink {
 public:
  explicit Writer(const std::filesystem::path& prefix)
      : positions_(with_suffix(prefix, ".positions")),
        colors_(with_suffix(prefix, ".colors")),
        uvs_(with_suffix(prefix, ".uvs")),
        normals_(with_suffix(prefix, ".normals")),
        triangles_(with_suffix(prefix, ".triangles")),
        uv_corners_(with_suffix(prefix, ".uv_corners")),
        normal_corners_(with_suffix(prefix, ".normal_corners")) {}

  void take(ObjBlock& block, const ObjCounts& before) override {
    constexpr ObjCounts kAll{kBadIndex, kBadIndex, kBadIndex};
    const BadIndices bad = resolve(block, before, kAll);
    largest_.push_back({bad.vertices ? kBadIndex : largest(block.v),
                        bad.attributes ? kBadIndex : largest(block.vt),
                        bad.attributes ? kBadIndex : largest(block.vn)});
    take_rows(block, before.v);
    take_faces(block);
    for (std::string& library : block.libraries) libraries.push_back(std::move(library));
    release(block);
  }

  std::optional<Bad> bad_index(const ObjCounts& total) const override {
    const auto beyond = [](int32_t index, uint64_t rows) {
      return index >= 0 && static_cast<uint64_t>(index) >= rows;
    };
    for (size_t k = 0; k < largest_.size(); ++k)
      if (beyond(largest_[k].vt, total.vt) || beyond(largest_[k].vn, total.vn)) return Bad{k, true};
    for (size_t k = 0; k < largest_.size(); ++k)
      if (beyond(largest_[k].v, total.v)) return Bad{k, false};
    return {};
  }

  /// The files, whole, as tables.
  TableLayout finish(const std::string& name) {
    for (RowFile* file : {&positions_, &triangles_}) file->open();
    TableLayout layout;
    TablePart part;
    part.name = name;
    part.triangles = triangles_.words() / 4;
    const auto table = [&](RowFile& file, uint32_t words, uint32_t size, uint32_t taken) {
      Column column;
      if (!file.is_there() && file.words() == 0) return column;
      file.commit();
      const auto number = static_cast<uint32_t>(layout.files.size());
      layout.files.push_back(file.path());
      layout.tables.push_back({number, 0, uint64_t{words} * size, file.words() / words, false});
      column.table = number;
      for (uint32_t k = 0; k < taken; ++k) column.offsets.push_back(k * size);
      return column;
    };
    const auto typed = [](Column column, Scalar type) {
      column.type = type;
      return column;
    };
    part.positions = typed(table(positions_, 3, 8, 3), Scalar::kF64);
    part.colors = table(colors_, 4, 4, 4);
    part.uvs = table(uvs_, 2, 4, 2);
    part.normals = table(normals_, 3, 4, 3);
    part.indices = typed(table(triangles_, 4, 4, 3), Scalar::kU32);
    part.uv_indices = typed(table(uv_corners_, 3, 4, 3), Scalar::kU32);
    part.normal_indices = typed(table(normal_corners_, 3, 4, 3), Scalar::kU32);
    // Rows that no corner names are no stream.
    if (!part.uv_indices.is_there()) part.uvs = {};
    if (!part.normal_indices.is_there()) part.normals = {};
    if (!names.empty()) {
      part.materials = part.indices;
      part.materials.offsets = {12};
    }
    layout.has_materials = !names.empty();
    part.color_scale = color_scale_.scale();
    part.are_colors_srgb = true;
    layout.parts.push_back(std::move(part));
    return layout;
  }

  std::vector<std::string> names, libraries;
  bool misses_material = false;
  uint64_t missing_normals = 0;  // of corners, where others have some

 private:
  struct Largest {
    int32_t v, vt, vn;
  };

  static int32_t largest(const ObjIndices& indices) {
    return indices.values.empty() ? kNoIndex
                                  : *std::max_element(indices.values.begin(), indices.values.end());
  }

  void take_rows(const ObjBlock& block, uint64_t vertices_before) {
    for (double value : block.positions) positions_.add(value);
    for (float value : block.uvs) uvs_.add(value);
    for (float value : block.normals) normals_.add(value);
    if (!block.colors.empty() && colors_.words() == 0) colors_.fill(4 * vertices_before, kNoColor);
    for (float value : block.colors) colors_.add(value);
    color_scale_.add(block.colors);
    if (block.colors.empty() && colors_.words() > 0) colors_.fill(4 * block.vertices(), kNoColor);
  }

  void take_faces(const ObjBlock& block) {
    const uint64_t before = triangles_.words() / 4 * 3;
    if (!block.vt.values.empty() && uv_corners_.words() == 0) uv_corners_.fill(before, kNone);
    if (!block.vn.values.empty() && normal_corners_.words() == 0) {
      normal_corners_.fill(before, kNone);
      missing_normals += before;
    }
    const bool has_uvs = !block.vt.values.empty() || uv_corners_.words() > 0;
    const bool has_normals = !block.vn.values.empty() || normal_corners_.words() > 0;
    const auto index = [](const ObjIndices& indices, size_t corner) {
      // kNoIndex becomes kNone.
      return indices.values.empty() ? kNone : static_cast<uint32_t>(indices.values[corner]);
    };
    size_t first = 0, use = 0;
    uint32_t triangle = 0;
    for (size_t face = 0; face < block.faces; ++face) {
      const uint32_t size = block.corners(face);
      for (uint32_t i = 2; i < size; ++i, ++triangle) {
        for (; use < block.uses.size() && block.uses[use].triangle <= triangle; ++use)
          material_ = number_of(block.names[block.uses[use].name]);
        const std::array<size_t, 3> corners{first, first + i - 1, first + i};
        for (size_t corner : corners) triangles_.add(index(block.v, corner));
        triangles_.add(material_);
        misses_material = misses_material || material_ == kNone;
        for (size_t corner : corners) {
          if (has_uvs) uv_corners_.add(index(block.vt, corner));
          if (!has_normals) continue;
          normal_corners_.add(index(block.vn, corner));
          if (index(block.vn, corner) == kNone) ++missing_normals;
        }
      }
      first += size;
    }
    for (; use < block.uses.size(); ++use) material_ = number_of(block.names[block.uses[use].name]);
  }

  uint32_t number_of(const std::string& name) {
    const auto next = static_cast<uint32_t>(names.size());
    const auto [known, is_new] = numbers_.try_emplace(name, next);
    if (is_new) names.push_back(name);
    return known->second;
  }

  /// Keeps what messages are made of.
  static void release(ObjBlock& block) {
    // Assigning {} would keep the memory.
    block.positions = std::vector<double>();
    for (auto* values : {&block.colors, &block.uvs, &block.normals}) *values = std::vector<float>();
    for (auto* indices : {&block.v, &block.vt, &block.vn}) *indices = ObjIndices();
    block.sizes = std::vector<uint32_t>();
    block.uses = std::vector<ObjBlock::Use>();
    for (auto* names : {&block.names, &block.libraries}) *names = std::vector<std::string>();
  }

  RowFile positions_, colors_, uvs_, normals_, triangles_, uv_corners_, normal_corners_;
  std::vector<Largest> largest_;
  std::unordered_map<std::string, uint32_t> numbers_;
  uint32_t material_ = kNone;
  ColorScaleFinder color_scale_;
};

}  // namespace

ObjTables write_obj_tables(const ByteSource& source, const std::string& name,
                           const std::filesystem::path& prefix, size_t block_bytes) {
  Writer writer(prefix);
  ObjTables tables;
  tables.notes = read_obj_blocks(source, name, writer, block_bytes);
  tables.layout = writer.finish(name);
  if (writer.missing_normals > 0)
    tables.notes.push_back(name + ": " + std::to_string(writer.missing_normals) +
                           " corners of triangles have no normals, as others have: there they are "
                           "zero");
  tables.has_materials = tables.layout.has_materials;
  tables.misses_material = writer.misses_material;
  tables.material_names = std::move(writer.names);
  tables.libraries = std::move(writer.libraries);
  return tables;
}

}  // namespace umbel::io
