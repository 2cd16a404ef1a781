#include "io/obj.hpp"

#include <tbb/parallel_pipeline.h>

#include <algorithm>
#include <mutex>
#include <optional>
#include <unordered_set>
#include <utility>

#include "base/parallel.hpp"
#include "io/obj_block.hpp"
#include "io/obj_join.hpp"
#include "io/obj_words.hpp"

namespace umbel::io {
namespace {

/// Texts that are read while others are parsed. Each is used again, so few are in memory.
class TextPool {
 public:
  TextBlock take() {
    const std::lock_guard lock(mutex_);
    if (unused_.empty()) return {};
    TextBlock text = std::move(unused_.back());
    unused_.pop_back();
    return text;
  }
  void give(TextBlock&& text) {
    const std::lock_guard lock(mutex_);
    unused_.push_back(std::move(text));
  }

 private:
  std::mutex mutex_;
  std::vector<TextBlock> unused_;
};

/// Whether the text's last line says anything.
bool last_line_counts(const TextBlock& text) {
  const char* p = text.end() - 1;  // the line's end
  while (p != text.begin() && p[-1] != '\n') --p;
  uint64_t lines = 0;
  skip_blanks(p, lines);
  return !at_line_end(p);
}

/// All blocks of a text, up to the first that has a fault.
struct Parsed {
  std::vector<ObjBlock> blocks;
  std::vector<ObjOffsets> offsets{1};  ///< of each block, and after them the whole file's size
  bool is_cut = false;                 ///< the last line has no end
};

/// `sink`, if there is one, gets each block before it is kept.
Parsed parse(TextBlocks& texts, ObjSink* sink) {
  struct Piece {
    ObjBlock block;
    bool is_cut = false;
  };
  Parsed parsed;
  TextPool pool;
  bool has_fault = false;
  std::mutex mutex;
  const auto read = [&](tbb::flow_control& control) {
    TextBlock text = pool.take();
    const std::lock_guard lock(mutex);
    if (has_fault || !texts.next(text)) control.stop();
    return text;
  };
  const auto parse_one = [&](TextBlock text) {
    Piece piece{parse_obj_block(text), text.is_cut && last_line_counts(text)};
    pool.give(std::move(text));
    return piece;
  };
  const auto append = [&](Piece piece) {
    const std::lock_guard lock(mutex);
    if (has_fault) return;
    has_fault = piece.block.fault.has_value();
    parsed.is_cut = piece.is_cut;
    const ObjOffsets before = parsed.offsets.back();
    parsed.offsets.push_back(after(before, piece.block));
    if (sink && !has_fault) sink->take(piece.block, before.rows);
    parsed.blocks.push_back(std::move(piece.block));
  };
  using tbb::filter_mode, tbb::make_filter;
  const size_t threads = usable_threads();
  tbb::parallel_pipeline(2 * threads,
                         make_filter<void, TextBlock>(filter_mode::serial_in_order, read) &
                             make_filter<TextBlock, Piece>(filter_mode::parallel, parse_one) &
                             make_filter<Piece, void>(filter_mode::serial_in_order, append));
  return parsed;
}

/// The objects and groups that have faces, in the order of their first.
std::vector<std::string> parts_of(const std::vector<ObjBlock>& blocks) {
  std::vector<std::string> parts;
  std::unordered_set<std::string> seen;
  const auto add = [&](const std::string& name) {
    if (seen.insert(name).second) parts.push_back(name);
  };
  std::optional<std::string> open;
  for (const ObjBlock& block : blocks) {
    if (block.continues_part && open) add(*open);
    for (const std::string& name : block.parts) add(name);
    if (block.open_part || block.continues_part || !block.parts.empty()) open = block.open_part;
  }
  return parts;
}

/// The first few names, as a sentence has them.
std::string some_of(const std::vector<std::string>& names) {
  constexpr size_t kMost = 3;
  std::string text;
  for (size_t k = 0; k < std::min(kMost, names.size()); ++k)
    (text += k > 0 ? ", '" : "'") += names[k] + "'";
  return names.size() > kMost ? text + ", ..." : text;
}

/// A file's blocks, and the sentences about them.
class ObjReader {
 public:
  ObjReader(const ByteSource& source, const std::string& name, size_t block_bytes)
      : name_(name), texts_(source, block_bytes) {}

  ObjMesh read() {
    const bool is_cut = parse_all(nullptr);
    const ObjOffsets& all = offsets_.back();
    check_counts(std::max(all.corners, all.triangles));
    const std::string fault = resolve_all();
    std::vector<std::string> notes = all_notes(is_cut);
    ObjMesh mesh = join(blocks_, offsets_);
    mesh.notes = std::move(notes);
    mesh.fault = fault;
    return mesh;
  }

  std::vector<std::string> read_to(ObjSink& sink) {
    const bool is_cut = parse_all(&sink);
    check_counts(0);
    if (const auto bad = sink.bad_index(offsets_.back().rows)) {
      const std::string what = bad_index(bad->block, bad->is_attribute);
      throw Error(bad->is_attribute ? ErrorCode::kCorrupt : ErrorCode::kInvalidMesh, what);
    }
    return all_notes(is_cut);
  }

 private:
  /// Whether the last line has no end.
  bool parse_all(ObjSink* sink) {
    Parsed parsed = parse(texts_, sink);
    blocks_ = std::move(parsed.blocks);
    offsets_ = std::move(parsed.offsets);
    check_statements();
    return parsed.is_cut;
  }

  std::vector<std::string> all_notes(bool is_cut) const {
    std::vector<std::string> notes = notes_of_lines();
    if (const std::vector<std::string> parts = parts_of(blocks_); parts.size() > 1)
      notes.push_back(name_ + ": its " + std::to_string(parts.size()) + " objects and groups (" +
                      some_of(parts) + ") become one mesh");
    if (is_cut)
      notes.push_back(at(offsets_.back().lines - 1) +
                      "the last line has no end; the file may be cut short");
    return notes;
  }

  std::string at(uint64_t line) const {
    return name_ + ", line " + std::to_string(line + 1) + ": ";
  }
  [[noreturn]] static void fail(const std::string& what) { throw Error(ErrorCode::kCorrupt, what); }

  /// Throws for what is no OBJ file, and for the first fault.
  void check_statements() const {
    bool is_known = false;
    for (size_t k = 0; k < blocks_.size(); ++k) {
      const ObjBlock& block = blocks_[k];
      const uint64_t before = offsets_[k].lines;
      if (!is_known && block.unknown.count > 0 &&
          block.unknown.first < block.first_known.value_or(block.lines + 1))
        fail(at(before + block.unknown.first) + block.unknown.word +
             " is no statement of OBJ; is this another kind of file?");
      is_known = is_known || block.first_known;
      if (block.fault) fail(at(before + block.fault->line) + block.fault->what);
    }
  }

  /// `others`: what else 32-bit indices number.
  void check_counts(uint64_t others) const {
    const ObjOffsets& all = offsets_.back();
    const std::string holds = name_ + " holds ";
    const bool says_empty =
        std::any_of(blocks_.begin(), blocks_.end(), [](const ObjBlock& b) { return b.says_empty; });
    if (all.triangles == 0 && !says_empty)
      fail(holds + std::to_string(all.rows.v) +
           " vertices and no faces: it is no mesh, a point cloud, or cut short");
    const uint64_t most = std::max({all.rows.v, all.rows.vt, all.rows.vn, others});
    if (most >= kBadIndex)
      throw Error(ErrorCode::kUnsupported,
                  holds + std::to_string(most) +
                      " vertices or corners, more than 32-bit indices can number");
  }

  /// What the first vertex index that is beyond the file's vertices is, if there is one; throws
  /// for one of the other tables.
  std::string resolve_all() {
    std::vector<BadIndices> bad(blocks_.size());
    parallel_for(blocks_.size(), 1, [&](size_t k) {
      bad[k] = resolve(blocks_[k], offsets_[k].rows, offsets_.back().rows);
    });
    for (size_t k = 0; k < blocks_.size(); ++k)
      if (bad[k].attributes) fail(bad_index(k, true));
    for (size_t k = 0; k < blocks_.size(); ++k)
      if (bad[k].vertices) return bad_index(k, false);
    return {};
  }

  std::string bad_index(size_t k, bool only_attributes) const {
    TextBlock text;
    texts_.again(blocks_[k].offset, blocks_[k].size, text);
    const auto fault =
        find_bad_index(text, offsets_[k].rows, offsets_.back().rows, only_attributes);
    if (!fault) return name_ + " has become another file while it was read";
    return at(offsets_[k].lines + fault->line) + fault->what;
  }

  std::vector<std::string> notes_of_lines() const {
    struct Kind {
      ObjLines ObjBlock::* lines;
      const char* what;
    };
    constexpr Kind kKinds[] = {
        {&ObjBlock::short_faces, "faces have fewer than three corners"},
        {&ObjBlock::points_and_lines, "points and lines make no triangles"},
        {&ObjBlock::curves, "lines are about curves and surfaces of free form"},
        {&ObjBlock::files, "lines name other files"},
        {&ObjBlock::unknown, "lines are no statements of OBJ"},
        {&ObjBlock::numbers, "further numbers fit no mesh"},
        {&ObjBlock::paint, "comments have colours of vertices"}};
    std::vector<std::string> notes;
    for (const Kind& kind : kKinds) {
      uint64_t count = 0;
      std::optional<uint64_t> first;
      std::string word;
      for (size_t k = 0; k < blocks_.size(); ++k) {
        const ObjLines& lines = blocks_[k].*kind.lines;
        if (!first && lines.count > 0) {
          first = offsets_[k].lines + lines.first;
          word = lines.word;
        }
        count += lines.count;
      }
      if (first)
        notes.push_back(at(*first) + "from here on " + std::to_string(count) + " " + kind.what +
                        " (" + word + ") and are left out");
    }
    return notes;
  }

  std::string name_;
  TextBlocks texts_;
  std::vector<ObjBlock> blocks_;
  std::vector<ObjOffsets> offsets_;
};

}  // namespace

std::vector<std::string> read_obj_blocks(const ByteSource& source, const std::string& name,
                                         ObjSink& sink, size_t block_bytes) {
  return ObjReader(source, name, block_bytes).read_to(sink);
}

ObjMesh read_obj(const ByteSource& source, const std::string& name, size_t block_bytes) {
  return ObjReader(source, name, block_bytes).read();
}

}  // namespace umbel::io
