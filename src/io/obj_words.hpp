// The words of an OBJ file's lines: blank space, numbers, indices, names. A pointer moves through
// text that ends with two line ends, so no function asks whether the text has ended.
#pragma once

#include <algorithm>
#include <charconv>
#include <cstdint>
#include <cstdlib>
#include <limits>
#include <string>
#include <system_error>

#include "io/text_blocks.hpp"

namespace umbel::io {

inline bool is_digit(char c) { return c >= '0' && c <= '9'; }

/// The place after a backslash at p and the line's end that it takes back; null if there is none.
inline const char* after_continuation(const char* p) {
  if (*p != '\\') return nullptr;
  do ++p;
  while (is_blank(*p));
  return *p == '\n' ? p + 1 : nullptr;
}

/// Whether a word ends before p.
inline bool at_word_end(const char* p) {
  return is_blank(*p) || *p == '\n' || (*p == '\\' && after_continuation(p) != nullptr);
}

/// Steps over blank space and continued line ends, which it counts.
inline void skip_blanks(const char*& p, uint64_t& lines) {
  for (;;) {
    while (is_blank(*p)) ++p;
    const char* const after = after_continuation(p);
    if (after == nullptr) return;
    p = after;
    ++lines;
  }
}

/// Whether nothing but a comment is left of the line, from the first word's place on.
inline bool at_line_end(const char* p) { return *p == '\n' || *p == '#'; }

inline const char* word_end(const char* p) {
  while (!at_word_end(p)) ++p;
  return p;
}

/// Numbers that the quick way does not read exactly: many digits, large exponents, "nan".
inline bool read_odd_number(const char*& p, double& value) {
  const char* const end = word_end(p);
  const char* begin = *p == '+' ? p + 1 : p;
  if (begin == end || (begin != p && *begin == '-')) return false;
#if defined(__cpp_lib_to_chars)
  const auto [stop, error] = std::from_chars(begin, end, value);
  if (stop != end) return false;
  if (error == std::errc::result_out_of_range) {
    const bool is_tiny = std::find(begin + 1, end, '-') != end;  // its exponent's sign
    value = is_tiny ? 0.0 : std::numeric_limits<double>::infinity();
    if (*begin == '-') value = -value;
  } else if (error != std::errc()) {
    return false;
  }
#else
  const std::string word(begin, end);
  char* stop = nullptr;
  value = std::strtod(word.c_str(), &stop);
  if (stop != word.c_str() + word.size()) return false;
#endif
  p = end;
  return true;
}

/// The number at p, correctly rounded; false, and p as it was, if there is none or more follows it.
inline bool read_number(const char*& p, double& value) {
  // Products and quotients of whole numbers below 2^53 and these powers are rounded once (Clinger
  // 1990, How to read floating point numbers accurately).
  constexpr double kTens[] = {1e0,  1e1,  1e2,  1e3,  1e4,  1e5,  1e6,  1e7,
                              1e8,  1e9,  1e10, 1e11, 1e12, 1e13, 1e14, 1e15,
                              1e16, 1e17, 1e18, 1e19, 1e20, 1e21, 1e22};
  const char* s = p;
  const bool negative = *s == '-';
  if (*s == '-' || *s == '+') ++s;
  uint64_t digits = 0;
  const char* const first = s;
  while (is_digit(*s)) digits = 10 * digits + static_cast<uint64_t>(*s++ - '0');
  int64_t count = s - first;
  int64_t exponent = 0;
  if (*s == '.') {
    const char* const point = ++s;
    while (is_digit(*s)) digits = 10 * digits + static_cast<uint64_t>(*s++ - '0');
    exponent = point - s;
    count += s - point;
  }
  if (count == 0 || count > 19) return read_odd_number(p, value);
  if (*s == 'e' || *s == 'E') {
    const bool is_down = *++s == '-';
    if (*s == '-' || *s == '+') ++s;
    int64_t given = 0;
    const char* const power = s;
    while (is_digit(*s) && s - power < 4) given = 10 * given + (*s++ - '0');
    if (s == power) return false;
    exponent += is_down ? -given : given;
  }
  if (!at_word_end(s) || digits > uint64_t{1} << 53 || exponent < -22 || exponent > 22)
    return read_odd_number(p, value);
  const double whole = static_cast<double>(digits);
  const double size = exponent < 0 ? whole / kTens[-exponent] : whole * kTens[exponent];
  value = negative ? -size : size;
  p = s;
  return true;
}

/// The whole number at p, or one far too large in its place; false if there is none.
inline bool read_index(const char*& p, int64_t& value) {
  constexpr int64_t kMost = std::numeric_limits<int64_t>::max() / 10 - 1;
  const char* s = p;
  const bool negative = *s == '-';
  if (*s == '-' || *s == '+') ++s;
  if (!is_digit(*s)) return false;
  int64_t size = 0;
  for (; is_digit(*s); ++s)
    if (size < kMost) size = 10 * size + (*s - '0');
  value = negative ? -size : size;
  p = s;
  return true;
}

/// The corner of a face at p: indices as written, 0 where there is none.
struct CornerText {
  int64_t v = 0, vt = 0, vn = 0;
};

inline bool read_corner(const char*& p, CornerText& corner) {
  corner.vt = corner.vn = 0;
  if (!read_index(p, corner.v)) return false;
  if (*p == '/') {
    ++p;
    if (*p != '/' && !at_word_end(p) && !read_index(p, corner.vt)) return false;
    if (*p == '/') {
      ++p;
      if (!at_word_end(p) && !read_index(p, corner.vn)) return false;
    }
  }
  return at_word_end(p);
}

/// Steps over a comment, which no backslash continues, and its line's end.
inline void skip_comment(const char*& p, uint64_t& lines) {
  while (*p != '\n') ++p;
  ++p;
  ++lines;
}

/// Steps over the rest of the line and its end.
inline void skip_line(const char*& p, uint64_t& lines) {
  for (;;) {
    skip_blanks(p, lines);
    if (at_line_end(p)) return skip_comment(p, lines);
    p = word_end(p);
  }
}

}  // namespace umbel::io
