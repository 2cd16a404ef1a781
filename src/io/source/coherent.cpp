#include "io/source/coherent.hpp"

#include <algorithm>
#include <cstring>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "base/bytes.hpp"
#include "base/file.hpp"
#include "io/source/gather.hpp"
#include "io/source/vertex_numbers.hpp"

namespace umbel::io {
namespace {

namespace fs = std::filesystem;

std::vector<Column*> vertex_columns(TablePart& part) {
  std::vector<Column*> all{&part.positions, &part.normals, &part.tangents, &part.uvs, &part.colors};
  for (ExtraColumn& extra : part.extras) all.push_back(&extra.column);
  return all;
}

/// The tables that hold vertices, each once.
std::vector<uint32_t> vertex_tables(TablePart part) {
  std::vector<uint32_t> tables;
  for (const Column* column : vertex_columns(part))
    if (column->is_there()) tables.push_back(column->table);
  std::sort(tables.begin(), tables.end());
  tables.erase(std::unique(tables.begin(), tables.end()), tables.end());
  return tables;
}

/// The vertices of some triangles, rising; the indices become numbers of those.
std::vector<uint32_t> read_block(const TableLayout& layout, const TablePart& part, uint64_t begin,
                                 uint64_t end, std::vector<uint32_t>& ids) {
  const Table& table = layout.tables[part.indices.table];
  const uint64_t vertices = layout.tables[part.positions.table].rows;
  const InputFile file(layout.files[table.file]);
  ids.clear();
  gather(file, table, part.indices, begin, end, ids);
  for (size_t i = 0; i < ids.size(); ++i)
    if (ids[i] >= vertices)
      throw Error(ErrorCode::kInvalidMesh,
                  part.name + ": triangle " + std::to_string(begin + i / 3) + " has vertex index " +
                      index_text(ids[i], part.indices.type) + ", of " + std::to_string(vertices) +
                      " there are");
  return number_vertices(ids);
}

/// Words that are appended to a file.
class WordFile {
 public:
  explicit WordFile(fs::path path) : path_(std::move(path)), file_(std::in_place, path_) {}
  const fs::path& path() const { return path_; }

  void add(std::span<const uint32_t> words) {
    for (uint32_t word : words) {
      buffer_.push_back(little_endian(word));
      if (buffer_.size() == kBuffer) flush();
    }
  }
  void commit() {
    flush();
    file_->commit_unflushed();
    file_.reset();
    buffer_ = std::vector<uint32_t>();
  }

 private:
  static constexpr size_t kBuffer = size_t{1} << 15;
  void flush() {
    const auto bytes = std::as_bytes(std::span(buffer_));
    file_->write(written_, bytes);
    written_ += bytes.size();
    buffer_.clear();
  }

  fs::path path_;
  std::optional<OutputFile> file_;
  std::vector<uint32_t> buffer_;
  uint64_t written_ = 0;
};

/// Removes files that are only needed for a while.
struct Removal {
  std::vector<fs::path> paths;
  ~Removal() {
    std::error_code ignored;
    for (const fs::path& path : paths) fs::remove(path, ignored);
  }
};

fs::path with_suffix(const fs::path& prefix, const std::string& suffix) {
  fs::path path = prefix;
  return path += suffix;
}

class Sorter {
 public:
  Sorter(TableLayout& layout, size_t part, fs::path prefix, const CoherenceConfig& config)
      : layout_(layout),
        which_(part),
        part_(layout.parts[part]),
        prefix_(std::move(prefix)),
        config_(config),
        tables_(vertex_tables(part_)) {
    uint64_t widest = 1;
    for (uint32_t t : tables_) widest = std::max(widest, layout.tables[t].stride);
    vertices_ = layout.tables[part_.positions.table].rows;
    range_ = std::max<uint64_t>(1, config.range_bytes / widest);
    ranges_ = static_cast<size_t>((vertices_ + range_ - 1) / range_);
  }

  void run() {
    distribute();
    for (uint32_t table : tables_) move_rows(table);
    add_parts();
  }

 private:
  /// Rows of a new vertex table that 32 bits can number, and their triangles.
  struct Stretch {
    uint64_t first_triangle, triangles, first_row, rows;
  };

  /// Writes the new indices, and the vertices that blocks use in each range.
  void distribute() {
    std::vector<std::unique_ptr<WordFile>> files;
    for (size_t r = 0; r < ranges_; ++r) {
      files.push_back(std::make_unique<WordFile>(with_suffix(prefix_, ".r" + std::to_string(r))));
      removal_.paths.push_back(files.back()->path());
    }
    WordFile indices(with_suffix(prefix_, ".indices"));
    std::vector<uint32_t> ids;
    for (uint64_t begin = 0; begin < part_.triangles; begin += config_.block) {
      const uint64_t end = std::min(begin + config_.block, part_.triangles);
      const std::vector<uint32_t> used = read_block(layout_, part_, begin, end, ids);
      if (stretches_.empty() || stretches_.back().rows + used.size() >= kNone)
        stretches_.push_back({begin, 0, rows_, 0});
      Stretch& stretch = stretches_.back();
      for (uint32_t& id : ids) id += static_cast<uint32_t>(stretch.rows);
      indices.add(ids);
      stretch.triangles += end - begin;
      stretch.rows += used.size();
      rows_ += used.size();
      size_t at = 0;
      for (size_t r = 0; r < ranges_; ++r) {
        const size_t from = at;
        while (at < used.size() && used[at] < (r + 1) * range_) ++at;
        files[r]->add(std::span(used).subspan(from, at - from));
        counts_.push_back(static_cast<uint32_t>(at - from));
      }
    }
    indices.commit();
    indices_ = indices.path();
    for (auto& file : files) file->commit();
  }

  /// Writes a table's rows in the order of the blocks.
  void move_rows(uint32_t number) {
    const Table& table = layout_.tables[number];
    const InputFile input(layout_.files[table.file]);
    const fs::path path = with_suffix(prefix_, ".rows" + std::to_string(number));
    OutputFile output(path);
    std::vector<std::byte> rows, moved, words;
    for (size_t r = 0; r < ranges_; ++r) {
      const uint64_t first = r * range_, count = std::min(range_, vertices_ - first);
      // The last row may end before its stride does.
      const uint64_t begin = table.offset + first * table.stride;
      rows.assign(count * table.stride, {});
      input.read(begin,
                 std::span(rows).first(std::min<uint64_t>(rows.size(), input.size() - begin)));
      const InputFile list(with_suffix(prefix_, ".r" + std::to_string(r)));
      uint64_t read = 0, row = 0;
      for (size_t block = 0; block * ranges_ < counts_.size(); ++block) {
        const uint32_t* counts = counts_.data() + block * ranges_;
        uint64_t before = 0, all = 0;
        for (size_t k = 0; k < ranges_; ++k) {
          before += k < r ? counts[k] : 0;
          all += counts[k];
        }
        words.resize(size_t{4} * counts[r]);
        moved.resize(counts[r] * table.stride);
        list.read(read, words);
        read += words.size();
        ByteReader in(words);
        for (size_t i = 0; i < counts[r]; ++i)
          std::memcpy(moved.data() + i * table.stride,
                      rows.data() + (in.u32() - first) * table.stride, table.stride);
        output.write((row + before) * table.stride, moved);
        row += all;
      }
    }
    output.commit_unflushed();
    moved_.push_back(path);
  }

  void add_parts() {
    std::vector<uint32_t> files;
    for (const fs::path& path : moved_) {
      files.push_back(static_cast<uint32_t>(layout_.files.size()));
      layout_.files.push_back(path);
    }
    const auto index_file = static_cast<uint32_t>(layout_.files.size());
    layout_.files.push_back(indices_);
    const auto add = [&](const Table& table) {
      layout_.tables.push_back(table);
      return static_cast<uint32_t>(layout_.tables.size() - 1);
    };
    std::vector<TablePart> parts;
    for (const Stretch& stretch : stretches_) {
      TablePart part = part_;
      part.triangles = stretch.triangles;
      for (size_t k = 0; k < tables_.size(); ++k) {
        const Table old = layout_.tables[tables_[k]];
        const uint32_t table = add(
            {files[k], stretch.first_row * old.stride, old.stride, stretch.rows, old.big_endian});
        for (Column* column : vertex_columns(part))
          if (column->is_there() && column->table == tables_[k])
            moved_to_.push_back({column, table});
      }
      for (const auto& [column, table] : std::exchange(moved_to_, {})) column->table = table;
      part.indices = {add({index_file, stretch.first_triangle * 12, 12, stretch.triangles, false}),
                      Scalar::kU32,
                      {0, 4, 8}};
      if (part.materials.is_there()) {
        Table materials = layout_.tables[part.materials.table];
        materials.offset += stretch.first_triangle * materials.stride;
        materials.rows = stretch.triangles;
        part.materials.table = add(materials);
      }
      parts.push_back(std::move(part));
    }
    const auto at = layout_.parts.begin() + static_cast<ptrdiff_t>(which_);
    layout_.parts.insert(layout_.parts.erase(at), parts.begin(), parts.end());
  }

  TableLayout& layout_;
  size_t which_;
  TablePart part_;
  fs::path prefix_, indices_;
  CoherenceConfig config_;
  std::vector<uint32_t> tables_;
  uint64_t vertices_ = 0, range_ = 1, rows_ = 0;
  size_t ranges_ = 0;
  std::vector<uint32_t> counts_;  // vertices of each block in each range
  std::vector<Stretch> stretches_;
  std::vector<fs::path> moved_;
  std::vector<std::pair<Column*, uint32_t>> moved_to_;
  Removal removal_;
};

}  // namespace

bool is_incoherent(const TableLayout& layout, const TablePart& part,
                   const CoherenceConfig& config) {
  if (!part.indices.is_there() || part.uv_indices.is_there() || part.normal_indices.is_there() ||
      part.positions.offsets.size() != 3)
    return false;
  const Table& table = layout.tables[part.positions.table];
  if (table.rows * table.stride < config.least_bytes) return false;
  constexpr uint64_t kSamples = 4;
  uint64_t needed = 0, read = 0;
  std::vector<uint32_t> ids;
  for (uint64_t k = 0; k < kSamples; ++k) {
    const uint64_t begin = part.triangles / kSamples * k;
    const uint64_t end = std::min(begin + config.block, part.triangles);
    const std::vector<uint32_t> used = read_block(layout, part, begin, end, ids);
    needed += used.size() * table.stride;
    for_runs(table, part.positions.end(), used,
             [&](size_t, size_t, uint64_t bytes) { read += std::max<uint64_t>(bytes, 4096); });
  }
  return read > config.most_waste * needed;
}

void make_coherent(TableLayout& layout, size_t part, const std::filesystem::path& prefix,
                   const CoherenceConfig& config) {
  Sorter(layout, part, prefix, config).run();
}

}  // namespace umbel::io
