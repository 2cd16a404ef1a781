// The prefix codes of connectivity.hpp's symbols, for encoder and decoder.
#pragma once

#include <array>
#include <cstdint>

namespace umbel::asset {

/// The third vertex of the triangle beyond an active edge.
enum Apex : uint32_t {
  kNew = 0,      ///< the next number
  kAfter = 1,    ///< the end of an open active edge that starts at b
  kBefore = 2,   ///< the start of an open active edge that ends at a
  kNamed = 3,    ///< its number follows
  kNothing = 4,  ///< no triangle: it has been visited from elsewhere
};

/// A triangle's apex, and whether its edges (b, c) and (c, a) become or close active edges, as one
/// number.
constexpr uint32_t symbol(uint32_t apex, bool right, bool left) {
  return 4 * apex + 2 * right + left;
}
inline constexpr uint32_t kSymbols = 4 * kNothing + 4;

/// One word of a prefix code.
struct Word {
  uint8_t symbol;
  uint8_t length;  ///< bits
  uint8_t code;    ///< the first bit lowest
};

inline constexpr uint32_t kLongestWord = 8;
using Words = std::array<Word, 13>;
/// Lengths follow the frequencies on scanned meshes. The code is complete: any bits decode.
inline constexpr Words kWords{{{symbol(kNew, true, true), 1, 0b1},
                               {symbol(kAfter, true, true), 3, 0b110},
                               {symbol(kBefore, true, true), 3, 0b010},
                               {symbol(kNew, false, true), 4, 0b1100},
                               {symbol(kNew, true, false), 4, 0b0100},
                               {symbol(kNew, false, false), 5, 0b11000},
                               {symbol(kAfter, true, false), 5, 0b01000},
                               {symbol(kBefore, false, true), 5, 0b10000},
                               {symbol(kNamed, true, true), 6, 0b100000},
                               {symbol(kNamed, false, true), 8, 0b11000000},
                               {symbol(kNamed, true, false), 8, 0b01000000},
                               {symbol(kNamed, false, false), 8, 0b10000000},
                               {symbol(kNothing, false, false), 8, 0b00000000}}};
/// The same words in the same order, for clusters of many small regions: most of their triangles
/// are at a border.
inline constexpr Words kBorderWords{{{symbol(kNew, true, true), 3, 0b100},
                                     {symbol(kAfter, true, true), 6, 0b110000},
                                     {symbol(kBefore, true, true), 5, 0b11000},
                                     {symbol(kNew, false, true), 2, 0b11},
                                     {symbol(kNew, true, false), 2, 0b01},
                                     {symbol(kNew, false, false), 2, 0b10},
                                     {symbol(kAfter, true, false), 6, 0b010000},
                                     {symbol(kBefore, false, true), 5, 0b01000},
                                     {symbol(kNamed, true, true), 8, 0b10000000},
                                     {symbol(kNamed, false, true), 7, 0b1100000},
                                     {symbol(kNamed, true, false), 7, 0b0100000},
                                     {symbol(kNamed, false, false), 7, 0b1000000},
                                     {symbol(kNothing, false, false), 8, 0b00000000}}};

}  // namespace umbel::asset
