#include "io/obj_block.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>
#include <unordered_map>
#include <unordered_set>

#include "io/obj_words.hpp"

namespace umbel::io {
namespace {

using std::string_view;

/// The nearest float; beyond the largest, infinity.
float to_float(double value) {
  constexpr double kLimit = 0x1.ffffffp127;  // half a step above the largest float
  if (value >= kLimit) return std::numeric_limits<float>::infinity();
  if (value <= -kLimit) return -std::numeric_limits<float>::infinity();
  return static_cast<float>(value);
}

/// A word as messages show it.
std::string shown(const char* begin, const char* end) {
  constexpr size_t kMost = 40;
  std::string text = "'";
  for (const char* p = begin; p != end && text.size() <= kMost; ++p) {
    const auto c = static_cast<unsigned char>(*p);
    constexpr char kHex[] = "0123456789abcdef";
    if (c < 32 || c == 127)
      (text += "\\x") += {kHex[c / 16], kHex[c % 16]};
    else
      text += *p;
  }
  return text + "'";
}

bool is_text(string_view word) {
  return std::none_of(word.begin(), word.end(),
                      [](char c) { return static_cast<unsigned char>(c) < 32 || c == 127; });
}

/// Statements that say nothing of a mesh of polygons: smoothing, ways to display.
constexpr std::array<string_view, 8> kSilent = {"s",        "mg",  "bevel",      "c_interp",
                                                "d_interp", "lod", "shadow_obj", "trace_obj"};
/// Curves and surfaces of free form.
constexpr std::array<string_view, 21> kCurves = {
    "cstype", "deg", "bmat", "step", "curv",  "curv2", "surf", "parm", "trim", "hole", "vp",
    "scrv",   "sp",  "end",  "con",  "ctech", "stech", "bsp",  "bzp",  "cdc",  "res"};
/// More of the scene in other files, commands, and maps by object.
constexpr std::array<string_view, 4> kFiles = {"call", "csh", "usemap", "maplib"};

template <size_t n>
bool is_one_of(string_view word, const std::array<string_view, n>& words) {
  return std::find(words.begin(), words.end(), word) != words.end();
}

class Parser {
 public:
  explicit Parser(const TextBlock& text) : p_(text.begin()), end_(text.end()) {
    block_.offset = text.offset;
    block_.size = text.size;
  }

  ObjBlock parse() {
    while (p_ < end_ && !block_.fault) statement();
    block_.lines = line_;
    block_.open_part = std::move(part_);
    return std::move(block_);
  }

 private:
  void statement() {
    skip_blanks(p_, line_);
    switch (*p_) {
      case '\n':
        ++p_;
        ++line_;
        return;
      case '#':
        return comment();
      case 'v':
        if (at_word_end(p_ + 1)) return known(1, [&] { vertex(); });
        if (p_[1] == 't' && at_word_end(p_ + 2)) return known(2, [&] { uv(); });
        if (p_[1] == 'n' && at_word_end(p_ + 2)) return known(2, [&] { normal(); });
        return other();
      case 'f':
        if (at_word_end(p_ + 1)) return known(1, [&] { face(); });
        return other();
      default:
        return other();
    }
  }

  void comment() {
    const string_view text(p_, static_cast<size_t>(end_ - p_));
    block_.says_empty |= text.starts_with("# no faces");
    if (text.starts_with("#MRGB ")) count(block_.paint, "#MRGB");  // as ZBrush writes them
    skip_comment(p_, line_);
  }

  /// A statement whose keyword has `letters`: read(), which stops at a comment or the line's end.
  template <typename Read>
  void known(size_t letters, const Read& read) {
    if (!block_.first_known) block_.first_known = line_;
    p_ += letters;
    read();
    if (!block_.fault) skip_comment(p_, line_);
  }

  void fail(std::string what) { block_.fault = {line_, std::move(what)}; }

  void count(ObjLines& lines, string_view word) {
    if (lines.count++ > 0) return;
    lines.first = line_;
    lines.word = std::string(word);
  }

  // --- tables

  /// The line's numbers, `least` to `most`; 0, and a fault, if there are not so many.
  size_t numbers(const char* keyword, size_t least, size_t most) {
    size_t count = 0;
    for (;; ++count) {
      skip_blanks(p_, line_);
      if (at_line_end(p_)) break;
      double value = 0;
      if (!read_number(p_, value)) {
        fail(shown(p_, word_end(p_)) + " is no number");
        return 0;
      }
      if (count < numbers_.size()) numbers_[count] = value;
    }
    if (count >= least && count <= most + 1) return count;
    fail(std::string("'") + keyword + "' has " + std::to_string(count) + " numbers, not " +
         std::to_string(least) + " to " + std::to_string(most));
    return 0;
  }

  void vertex() {
    const size_t n = numbers("v", 3, 7);
    if (n == 0) return;
    if ((n == 4 && numbers_[3] != 1) || n == 5 || n > 7) count(block_.numbers, "v");
    if (n >= 6 && block_.colors.empty()) block_.colors.assign(4 * block_.vertices(), kNoColor);
    block_.positions.insert(block_.positions.end(), numbers_.begin(), numbers_.begin() + 3);
    if (n < 6 && block_.colors.empty()) return;
    for (size_t k = 3; k < 6; ++k)
      block_.colors.push_back(n < 6 ? kNoColor : to_float(numbers_[k]));
    block_.colors.push_back(n == 7 ? to_float(numbers_[6]) : kNoColor);
  }

  void uv() {
    const size_t n = numbers("vt", 1, 3);
    if (n == 0) return;
    if (n > 3 || (n == 3 && numbers_[2] != 0)) count(block_.numbers, "vt");
    block_.uvs.push_back(to_float(numbers_[0]));
    block_.uvs.push_back(n > 1 ? to_float(numbers_[1]) : 0);
  }

  void normal() {
    const size_t n = numbers("vn", 3, 3);
    if (n == 0) return;
    if (n > 3) count(block_.numbers, "vn");
    for (size_t k = 0; k < 3; ++k) block_.normals.push_back(to_float(numbers_[k]));
  }

  // --- faces

  void face() {
    const size_t first = block_.v.values.size();
    const bool has_vt = !block_.vt.values.empty(), has_vn = !block_.vn.values.empty();
    uint32_t size = 0;
    CornerText corner;
    for (;; ++size) {
      skip_blanks(p_, line_);
      if (at_line_end(p_)) break;
      const char* const word = p_;
      if (!read_corner(p_, corner))
        return fail(shown(word, word_end(word)) +
                    " is no corner of a face, which is v, v/vt, v//vn or v/vt/vn");
      if (corner.v == 0) return fail("vertex index 0; OBJ counts from 1");
      const size_t at = block_.v.values.size();
      add(block_.vt, corner.vt, block_.uvs.size() / 2, at);
      add(block_.vn, corner.vn, block_.normals.size() / 3, at);
      add(block_.v, corner.v, block_.vertices(), at);
    }
    if (size < 3) {
      count(block_.short_faces, "f");
      shorten(block_.v, first);
      shorten(block_.vt, has_vt ? first : 0);
      shorten(block_.vn, has_vn ? first : 0);
      return;
    }
    if (size != 3 || !block_.sizes.empty()) {
      if (block_.sizes.empty()) block_.sizes.assign(block_.faces, 3);
      block_.sizes.push_back(size);
    }
    ++block_.faces;
    block_.triangles += size - 2;
    if (part_) {
      if (parts_.insert(*part_).second) block_.parts.push_back(*std::move(part_));
      part_.reset();
    } else {
      block_.continues_part |= !has_part_;
    }
  }

  /// Of corner `at`, in a table that has `rows` rows so far.
  static void add(ObjIndices& indices, int64_t given, size_t rows, size_t at) {
    std::vector<int32_t>& values = indices.values;
    if (given == 0 && values.empty()) return;
    if (values.empty()) values.assign(at, kNoIndex);
    const int64_t back = static_cast<int64_t>(rows) + given;
    if (given == 0) {
      values.push_back(kNoIndex);
    } else if (given > 0) {
      values.push_back(given < kBadIndex ? static_cast<int32_t>(given - 1) : kBadIndex);
    } else if (back > -kBadIndex) {
      indices.relative.push_back(static_cast<uint32_t>(at));
      values.push_back(static_cast<int32_t>(std::min<int64_t>(back, kBadIndex)));
    } else {
      values.push_back(kBadIndex);
    }
  }

  static void shorten(ObjIndices& indices, size_t corners) {
    if (indices.values.size() > corners) indices.values.resize(corners);
    while (!indices.relative.empty() && indices.relative.back() >= corners)
      indices.relative.pop_back();
  }

  // --- everything else

  void other() {
    const char* const stop = word_end(p_);
    const string_view word(p_, static_cast<size_t>(stop - p_));
    if (!is_text(word)) return fail(shown(p_, stop) + " is no text: the file is damaged or binary");
    if (word == "fo") return known(2, [&] { face(); });
    if (word == "o" || word == "g") return known(1, [&] { part(rest()); });
    const bool is_use = word == "usemtl";
    const bool is_element = word == "l" || word == "p";
    const bool is_curve = is_one_of(word, kCurves), is_file = is_one_of(word, kFiles);
    if (is_use || word == "mtllib")
      return known(word.size(), [&] { is_use ? use(rest()) : block_.libraries.push_back(rest()); });
    if (is_element) count(block_.points_and_lines, word);
    if (is_curve) count(block_.curves, word);
    if (is_file) count(block_.files, word);
    if (is_element || is_curve || is_file || is_one_of(word, kSilent)) {
      if (!block_.first_known) block_.first_known = line_;
    } else {
      count(block_.unknown, shown(p_, stop));
    }
    skip_line(p_, line_);
  }

  /// What is left of the line except for a comment, without blank space around it.
  std::string rest() {
    std::string text;
    for (;;) {
      const char* const before = p_;
      const uint64_t line = line_;
      skip_blanks(p_, line_);
      if (at_line_end(p_)) return text;
      if (!text.empty()) line == line_ ? text.append(before, p_) : text.append(" ");
      const char* const stop = word_end(p_);
      text.append(p_, stop);
      p_ = stop;
    }
  }

  void use(std::string name) {
    const auto [known, is_new] =
        numbers_of_names_.try_emplace(name, static_cast<uint32_t>(block_.names.size()));
    block_.uses.push_back({block_.triangles, known->second});
    if (is_new) block_.names.push_back(std::move(name));
  }

  void part(std::string name) {
    part_ = std::move(name);
    has_part_ = true;
  }

  ObjBlock block_;
  std::optional<std::string> part_;  // that no face is in yet
  bool has_part_ = false;
  std::unordered_set<std::string> parts_;
  const char* p_;
  const char* end_;
  uint64_t line_ = 0;
  std::array<double, 8> numbers_{};
  std::unordered_map<std::string, uint32_t> numbers_of_names_;
};

/// What is wrong with an index as written, if anything is.
std::optional<std::string> problem(const char* what, int64_t given, uint64_t seen, uint64_t total) {
  if (given == 0) return std::nullopt;
  const bool is_back = given < 0;
  if (is_back ? static_cast<uint64_t>(-given) <= seen : static_cast<uint64_t>(given) <= total)
    return std::nullopt;
  return std::string(what) + " index " + std::to_string(given) + " is beyond the " +
         std::to_string(is_back ? seen : total) + (is_back ? " so far" : " there are");
}

}  // namespace

ObjBlock parse_obj_block(const TextBlock& text) { return Parser(text).parse(); }

std::optional<ObjBlock::Fault> find_bad_index(const TextBlock& text, ObjCounts before,
                                              const ObjCounts& total, bool only_attributes) {
  uint64_t line = 0;
  for (const char* p = text.begin(); p < text.end(); skip_line(p, line)) {
    skip_blanks(p, line);
    const string_view word(p, static_cast<size_t>(word_end(p) - p));
    before.v += word == "v";
    before.vt += word == "vt";
    before.vn += word == "vn";
    if (word != "f" && word != "fo") continue;
    CornerText corner;
    std::optional<ObjBlock::Fault> found;
    size_t size = 0;
    p += word.size();
    for (skip_blanks(p, line); !at_line_end(p) && read_corner(p, corner); skip_blanks(p, line)) {
      std::optional<std::string> what;
      if (!only_attributes) what = problem("vertex", corner.v, before.v, total.v);
      if (!what) what = problem("texture coordinate", corner.vt, before.vt, total.vt);
      if (!what) what = problem("normal", corner.vn, before.vn, total.vn);
      if (what && !found) found = ObjBlock::Fault{line, *what};
      ++size;
    }
    if (found && size >= 3) return found;  // smaller faces are left out
  }
  return std::nullopt;
}

}  // namespace umbel::io
