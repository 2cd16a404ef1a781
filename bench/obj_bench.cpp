// Time and memory to read OBJ: Umbel's reader, on all threads and on one, and ufbx where
// -DUMBEL_BENCH_UFBX=ON brought it.
//
//   obj_bench [--runs 5] [--write big.obj --side 1196] [files]
//
// `--write` makes a terrain of side^2 vertices with texture coordinates and normals first: 313 MB
// with a side of 1196. ufbx does not join corners into vertices, which Umbel's figures include.
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <functional>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include "base/parallel.hpp"
#include "io/obj.hpp"
#include "peak_memory.hpp"
#include "timing.hpp"

#ifdef UMBEL_HAS_UFBX
#include "ufbx.c"
#endif

namespace {

void write_terrain(const std::string& path, int side) {
  std::FILE* file = std::fopen(path.c_str(), "w");
  if (file == nullptr) throw std::runtime_error("cannot write " + path);
  std::mt19937 random(1);
  std::normal_distribution<double> noise(0, 0.05);
  const auto for_each = [&](const auto& line) {
    for (int y = 0; y < side; ++y)
      for (int x = 0; x < side; ++x) line(x, y);
  };
  for_each([&](int x, int y) {
    const double z = 20 * std::sin(0.005 * x) * std::cos(0.0075 * y) + noise(random);
    std::fprintf(file, "v %.6f %.6f %.6f\n", 0.25 * x, 0.25 * y, z);
  });
  for_each([&](int x, int y) {
    std::fprintf(file, "vt %.6f %.6f\n", x / (side - 1.0), y / (side - 1.0));
  });
  for_each([&](int x, int y) {
    const double a = 0.4 * std::cos(0.005 * x), b = 0.6 * std::sin(0.0075 * y);
    const double length = std::sqrt(a * a + b * b + 1);
    std::fprintf(file, "vn %.6f %.6f %.6f\n", a / length, b / length, 1 / length);
  });
  std::fputs("usemtl ground\ns 1\n", file);
  const auto triangle = [&](int a, int b, int c) {
    std::fprintf(file, "f %d/%d/%d %d/%d/%d %d/%d/%d\n", a, a, a, b, b, b, c, c, c);
  };
  for (int y = 0; y + 1 < side; ++y)
    for (int x = 0; x + 1 < side; ++x) {
      const int a = y * side + x + 1;
      triangle(a, a + 1, a + side + 1);
      triangle(a, a + side + 1, a + side);
    }
  std::fclose(file);
}

struct Reader {
  const char* name;
  std::function<size_t(const std::string&)> triangles;
};

size_t read_ours(const std::string& path, uint32_t threads) {
  size_t triangles = 0;
  umbel::with_threads(threads, [&] {
    const umbel::InputFile file(path);
    triangles = umbel::io::read_obj(umbel::io::ByteSource(file), path).triangles.size();
  });
  return triangles;
}

std::vector<Reader> readers() {
  std::vector<Reader> all{
      {"umbel", [](const std::string& path) { return read_ours(path, 0); }},
      {"umbel, 1 thread", [](const std::string& p) { return read_ours(p, 1); }}};
#ifdef UMBEL_HAS_UFBX
  all.push_back({"ufbx", [](const std::string& path) {
                   ufbx_error error;
                   ufbx_scene* scene = ufbx_load_file(path.c_str(), nullptr, &error);
                   if (scene == nullptr) throw std::runtime_error(error.description.data);
                   size_t triangles = 0;
                   for (const ufbx_mesh* mesh : scene->meshes) triangles += mesh->num_triangles;
                   ufbx_free_scene(scene);
                   return triangles;
                 }});
#endif
  return all;
}

double processor_seconds() {
  timespec t;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

struct Measured {
  std::vector<double> seconds, processor, mib;
  size_t triangles = 0;
};

void measure(const Reader& reader, const std::string& path, Measured& measured) {
  const auto begin = std::chrono::steady_clock::now();
  const double before = processor_seconds();
  measured.mib.push_back(bench::peak_mib([&] { measured.triangles = reader.triangles(path); }));
  measured.processor.push_back(processor_seconds() - before);
  const std::chrono::duration<double> wall = std::chrono::steady_clock::now() - begin;
  measured.seconds.push_back(wall.count());
}

int run(const bench::Arguments& arguments) {
  std::vector<std::string> files = arguments.meshes();
  for (const std::string& path : arguments.all("write")) {
    write_terrain(path, arguments.number("side", 1196, 2));
    files.push_back(path);
  }
  const std::vector<Reader> all = readers();
  for (const std::string& path : files) {
    if (!path.ends_with(".obj")) continue;
    std::vector<Measured> measured(all.size());
    for (int k = 0; k < arguments.number("runs", 5, 1); ++k)  // in turns
      for (size_t i = 0; i < all.size(); ++i) measure(all[i], path, measured[i]);
    for (size_t i = 0; i < all.size(); ++i)
      std::printf("%s  %-16s %6.2f s, %5.2f s of the processor, %5.0f MiB, %zu triangles\n",
                  path.c_str(), all[i].name, bench::median(measured[i].seconds),
                  bench::median(measured[i].processor), bench::median(measured[i].mib),
                  measured[i].triangles);
  }
  return 0;
}

}  // namespace

int main(int argc, char** argv) { return bench::run_program("obj_bench", argc, argv, run); }
