#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <span>
#include <string>

#include "base/parallel.hpp"
#include "io/obj.hpp"
#include "io/obj_words.hpp"

namespace umbel::io {
namespace {

ObjMesh read(const std::string& text, size_t block_bytes = size_t{1} << 20) {
  return read_obj(ByteSource(std::as_bytes(std::span(text))), "a.obj", block_bytes);
}

std::string refusal(const std::string& text, size_t block_bytes = size_t{1} << 20) {
  try {
    read(text, block_bytes);
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

/// A file with everything that the reader knows, in a random mixture.
std::string random_text(uint32_t seed) {
  std::mt19937 random(seed);
  const auto below = [&](uint32_t n) { return static_cast<int>(random() % n); };
  const char* const ends[] = {"\n", "\r\n", " # c\n", "\t\n", " \\ \f\r\n \n"};
  int v = 0, vt = 0, vn = 0;
  std::string text = "# made for a test\n";
  const auto end = [&] { text += ends[below(5)]; };
  const auto number = [&] { (text += ' ') += std::to_string(below(1000) / 8.0 - 50); };
  const auto index = [&](int count) {
    const int k = below(static_cast<uint32_t>(count)) + 1;
    return std::to_string(random() % 3 ? k : k - count - 1);
  };
  for (int line = 0; line < 200; ++line) {
    const int kind = below(10);
    if (kind < 3 || v < 3 || vt == 0 || vn == 0) {
      text += 'v';
      for (int k = 0; k < (seed % 4 == 0 && kind == 0 ? 6 : 3); ++k) number();
      ++v;
      end();
      text += kind % 2 ? "vt" : "vn";
      for (int k = 0; k < (kind % 2 ? 2 : 3); ++k) number();
      ++(kind % 2 ? vt : vn);
    } else if (kind < 8) {
      text += 'f';
      for (int k = 3 + below(3); k > 0; --k) {
        text += below(20) ? " " : " \\\r\n";
        text += index(v);
        if (seed % 3 == 1) (text += '/') += index(vt);
        if (seed % 3 == 2) ((text += '/') += below(2) ? index(vt) : "") += '/' + index(vn);
      }
    } else {
      text += kind == 8 ? "usemtl m" + std::to_string(below(4)) : std::string("g some group");
    }
    end();
  }
  return text;
}

void expect_same(const ObjMesh& a, const ObjMesh& b) {
  EXPECT_EQ(a.positions, b.positions);
  EXPECT_EQ(a.colors, b.colors);
  EXPECT_EQ(a.uvs, b.uvs);
  EXPECT_EQ(a.normals, b.normals);
  EXPECT_EQ(a.without_normal, b.without_normal);
  EXPECT_EQ(a.triangles, b.triangles);
  EXPECT_EQ(a.materials, b.materials);
  EXPECT_EQ(a.material_names, b.material_names);
  EXPECT_EQ(a.notes, b.notes);
  EXPECT_EQ(a.fault, b.fault);
}

TEST(Obj, numbers_are_rounded_as_the_standard_library_rounds_them) {
  std::mt19937_64 random(1);
  const auto check = [](const std::string& word) {
    const std::string text = word + "\n\n";
    const char* p = text.data();
    double value = 0;
    ASSERT_TRUE(read_number(p, value)) << word;
    EXPECT_EQ(p, text.data() + word.size());
    const double expected = std::strtod(word.c_str(), nullptr);
    EXPECT_EQ(std::isnan(value), std::isnan(expected)) << word;
    if (!std::isnan(expected)) EXPECT_EQ(value, expected) << word;
    EXPECT_EQ(std::signbit(value), std::signbit(expected)) << word;
  };
  for (const char* word : {"0",
                           "-0",
                           "+5",
                           "1.",
                           ".5",
                           "-.5e3",
                           "1e22",
                           "1e23",
                           "9007199254740993",
                           "123456789012345678",
                           "12345678901234567890",
                           "0.1",
                           "1e-22",
                           "1e-23",
                           "1e400",
                           "-1e400",
                           "1e-400",
                           "-1e-400",
                           "nan",
                           "inf",
                           "-Infinity",
                           "4.9e-324",
                           "1.7976931348623157e308",
                           "0.000000000000000000000001"})
    check(word);
  for (int i = 0; i < 20000; ++i) {
    char word[64];
    const double mantissa = static_cast<double>(static_cast<int64_t>(random())) * 0x1p-63;
    const int digits = static_cast<int>(random() % 20);
    const double power = std::pow(10.0, static_cast<double>(random() % 50) - 25);
    std::snprintf(word, sizeof word, random() % 2 ? "%.*g" : "%.*f", digits, mantissa * power);
    check(word);
  }
}

TEST(Obj, what_is_no_number_is_left_where_it_is) {
  for (const char* word : {"", "-", "+", ".", "e5", "1e", "1e+", "1x", "1.2.3", "0x10", "+-1",
                           "1,5", "--1", "1.#QNAN", "nanx", "1e5x"}) {
    const std::string text = std::string(word) + "\n\n";
    const char* p = text.data();
    double value = 0;
    EXPECT_FALSE(read_number(p, value)) << word;
    EXPECT_EQ(p, text.data());
  }
}

TEST(Obj, blocks_of_any_size_and_any_number_of_threads_give_the_same) {
  for (uint32_t seed = 0; seed < 24; ++seed) {
    const std::string text = random_text(seed);
    const ObjMesh whole = read(text);
    EXPECT_FALSE(whole.triangles.empty());
    for (const size_t block : {size_t{1}, size_t{7}, size_t{64}, size_t{1000}})
      expect_same(read(text, block), whole);
    with_threads(1, [&] { expect_same(read(text, 64), whole); });
    with_threads(3, [&] { expect_same(read(text, 64), whole); });
  }
}

TEST(Obj, faults_are_named_with_their_line_whatever_the_blocks) {
  const std::string square = "v 0 0 0\nv 1 0 0\nv 1 1 0\nvt 0 0\n";
  const std::pair<const char*, const char*> cases[] = {
      {"f 1 2 x\nf 1 2 y\n",
       "a.obj, line 5: 'x' is no corner of a face, which is v, v/vt, v//vn or v/vt/vn"},
      {"f 1 2 \\\n0\n", "a.obj, line 6: vertex index 0; OBJ counts from 1"},
      {"v 1 2\n", "a.obj, line 5: 'v' has 2 numbers, not 3 to 7"},
      {"f 1 2 3\n\nf 1/1 2/1 3/7\n",
       "a.obj, line 7: texture coordinate index 7 is beyond the 1 there are"},
      {"f 1/9 2\nf 1/8 2 3\n",  // the first is no face
       "a.obj, line 6: texture coordinate index 8 is beyond the 1 there are"},
      {"f 1//1 2 3\n", "a.obj, line 5: normal index 1 is beyond the 0 there are"},
      {"f 1 2 3/-2\n", "a.obj, line 5: texture coordinate index -2 is beyond the 1 so far"},
      {"\x01\x02 f\n", "a.obj, line 5: '\\x01\\x02' is no text: the file is damaged or binary"}};
  for (const auto& [text, says] : cases)
    for (const size_t block : {size_t{1}, size_t{5}, size_t{1} << 20}) {
      const std::string more = std::string(text) + "f 1 2 3\n";
      EXPECT_EQ(refusal(square + more, block), says);
    }
}

TEST(Obj, a_vertex_that_is_not_there_is_kept_and_named_as_written) {
  const ObjMesh mesh = read("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nf 1 2 9\nf -5 1 2\n");
  EXPECT_EQ(mesh.fault, "a.obj, line 6: vertex index 9 is beyond the 4 there are");
  EXPECT_EQ(mesh.triangles[1], (Triangle{0, 1, kNone}));
  EXPECT_EQ(mesh.triangles[2], (Triangle{kNone, 0, 1}));
  const ObjMesh back = read("v 0 0 0\nv 1 0 0\nv 1 1 0\nf -4 1 2\n");
  EXPECT_EQ(back.fault, "a.obj, line 4: vertex index -4 is beyond the 3 so far");
  EXPECT_EQ(read("v 0 0 0\nf 1 1 99999999999999999999\n").fault.substr(0, 14), "a.obj, line 2:");
}

TEST(Obj, what_is_no_mesh_is_refused) {
  EXPECT_EQ(refusal("hello world\n"),
            "a.obj, line 1: 'hello' is no statement of OBJ; is this another kind of file?");
  EXPECT_NE(refusal(""), "");
  EXPECT_NE(refusal("# only a comment\n"), "");
  EXPECT_NE(refusal("v 1 2 3\n"), "");
  EXPECT_NE(refusal("v 1 2 3\np 1\n"), "");
  EXPECT_EQ(refusal("# no faces\n"), "");
}

TEST(Obj, numbers_that_fit_no_mesh_are_noted) {
  const std::string face = "f 1 2 3\n";
  const auto note = [&](const std::string& line) {
    const ObjMesh mesh = read("v 0 0 0\nv 1 0 0 1\nv 1 1 0\n" + line + "\n" + face);
    return mesh.notes.empty() ? std::string() : mesh.notes.at(0);
  };
  for (const char* line :
       {"v 1 2 3 1", "v 1 2 3 1 1 1", "v 1 2 3 1 1 1 1", "vt 1 2 0", "vn 0 0 1", "# MRGB", "#"})
    EXPECT_EQ(note(line), "") << line;
  for (const char* line : {"v 1 2 3 0.5", "v 1 2 3 4 5", "v 1 2 3 1 1 1 1 1", "vt 1 2 3",
                           "vt 1 2 0 0", "vn 0 0 1 0"}) {
    const std::string word(line, std::string_view(line).find(' '));
    EXPECT_EQ(note(line), "a.obj, line 4: from here on 1 further numbers fit no mesh (" + word +
                              ") and are left out")
        << line;
  }
  EXPECT_EQ(note("#MRGB ffffffffff808080"),
            "a.obj, line 4: from here on 1 comments have colours of vertices (#MRGB) and are left "
            "out");
}

TEST(Obj, what_is_left_out_is_noted_once_a_kind) {
  const ObjMesh mesh = read(
      "v 0 0 0\nv 1 0 0\nv 1 1 0\nl 1 2\nl 2 3\np 1\nf 1 2\nf 1 2 3\nwhatever 1\nsurf 1\nf 3 2 1");
  ASSERT_EQ(mesh.notes.size(), 5u);
  EXPECT_NE(mesh.notes[0].find("line 7: from here on 1 faces"), std::string::npos) << mesh.notes[0];
  EXPECT_NE(mesh.notes[1].find("line 4: from here on 3 points"), std::string::npos);
  EXPECT_NE(mesh.notes[2].find("line 10"), std::string::npos);
  EXPECT_NE(mesh.notes[3].find("'whatever'"), std::string::npos);
  EXPECT_NE(mesh.notes[4].find("line 11: the last line has no end"), std::string::npos);
}

TEST(Obj, faces_of_two_corners_leave_nothing_behind) {
  const ObjMesh mesh = read("v 0 0 0\nv 1 0 0\nv 1 1 0\nvt 0 0\nf 1 2 3\nf 1/1 -2/-1\nf 3 2 1\n");
  EXPECT_TRUE(mesh.uvs.empty());
  EXPECT_EQ(mesh.triangles, (std::vector<Triangle>{{0, 1, 2}, {2, 1, 0}}));
}

TEST(Obj, many_combinations_at_one_vertex_take_no_square_of_time) {
  std::string text = "v 0 0 0\nv 1 0 0\nv 1 1 0\n";
  constexpr int kCount = 60000;
  for (int i = 0; i < kCount; ++i) text += "vt " + std::to_string(i) + " 0\n";
  for (int i = 1; i <= kCount; ++i) text += "f 1/" + std::to_string(i) + " 2/1 3/1\n";
  const ObjMesh mesh = read(text);
  EXPECT_EQ(mesh.positions.size(), kCount + 2u);
  EXPECT_EQ(mesh.uvs[kCount - 1].x, kCount - 1.0f);
}

}  // namespace
}  // namespace umbel::io
