// Fuzzes streaming: a small asset whose pages come late, wrong, cut off or not at all, and cameras
// that leap anywhere. What is shown must be of pages in memory that are whole, the budget must be
// kept to, and in the end all pages must be found again.
#include <cstring>
#include <limits>
#include <memory>
#include <utility>
#include <vector>

#include "c_interface.hpp"
#include "container_bytes.hpp"
#include "umbel/asset.hpp"
#include "umbel/lod.hpp"
#include "umbel/stream.hpp"
#include "umbel/umbel.hpp"

namespace {

using umbel::fuzz::Bytes;
using umbel::fuzz::expect;
using umbel::fuzz::Input;

Bytes written(const umbel::Mesh& mesh, bool exact) {
  umbel::lod::Config config;
  config.max_triangles = 16;
  config.min_group = 2;
  config.max_group = 4;
  umbel::BuildOptions options;
  options.threads = 1;
  umbel::AssetConfig stored = exact ? umbel::AssetConfig::exact() : umbel::AssetConfig{};
  stored.page_bytes = 4096;
  umbel::write_asset(umbel::fuzz::scratch(), umbel::lod::build(mesh.view(), config, options), "{}",
                     options, stored);
  return umbel::fuzz::read_file();
}

const std::vector<Bytes>& assets() {
  static const std::vector<Bytes> all{written(umbel::shapes::sphere(4), false),
                                      written(umbel::shapes::terrain(32, 32, 1), true)};
  return all;
}

/// Brings a page now or later: as it is, with other bytes, or not.
class Loader : public umbel::PageLoader {
 public:
  Loader(const umbel::Asset& asset, Input& in) : asset_(asset), in_(in) {}

  void request(uint32_t page) override { asked_.push_back(page); }
  bool cancel(uint32_t page) override {
    if (in_.below(2)) return false;
    return std::erase(asked_, page) > 0;
  }
  std::vector<umbel::PageArrival> poll() override {
    std::vector<umbel::PageArrival> come;
    std::vector<uint32_t> later;
    for (const uint32_t page : asked_) {
      if (in_.seldom(4))
        later.push_back(page);
      else
        come.push_back(arrival(page));
    }
    // Pages that nobody asked for, and some twice.
    if (in_.seldom(16)) come.push_back(arrival(in_.below(asset_.info().pages)));
    asked_ = std::move(later);
    return come;
  }

 private:
  umbel::PageArrival arrival(uint32_t page) {
    umbel::PageArrival result;
    result.page = page;
    if (in_.seldom(8)) {
      result.problem = "lost";
      return result;
    }
    try {
      result.data = std::make_shared<const umbel::AssetPage>(asset_.page_of(page, bytes_of(page)));
    } catch (const umbel::Error& error) {
      expect(error.code() == umbel::ErrorCode::kCorrupt, "a page is refused for another reason");
      result.problem = error.what();
    }
    return result;
  }

  std::vector<std::byte> bytes_of(uint32_t page) {
    std::vector<std::byte> bytes = asset_.read_page(page).bytes;
    if (in_.seldom(4)) bytes[in_.bytes.integral<uint16_t>() % bytes.size()] ^= std::byte{1};
    if (in_.seldom(16)) bytes.resize(in_.bytes.integral<uint16_t>() % (2 * bytes.size()));
    return bytes;
  }

  const umbel::Asset& asset_;
  Input& in_;
  std::vector<uint32_t> asked_;
};

umbel::Vec3 eye_of(Input& in) {
  const umbel_vec3 p = in.point();
  const float far = in.seldom(4) ? 1e20f : 1;
  return {p.x * far, p.y * far, p.z * far};
}

umbel::StreamView any_view(Input& in) {
  umbel::StreamView view;
  if (in.seldom(32)) view.mesh = in.below(3);
  const float threshold = in.number() * (in.seldom(4) ? 1 : 0.05f);
  view.view.kind = in.below(4) ? umbel::lod::View::Kind::kCamera : umbel::lod::View::Kind::kError;
  view.view.eye = eye_of(in);
  view.view.error = view.view.threshold = threshold;
  if (in.likes(2)) {
    const umbel_vec3 n = in.point();
    view.planes.push_back({{n.x, n.y, n.z}, in.number()});
  }
  return view;
}

void check(const umbel::Asset& asset, const umbel::Residency& residency, uint64_t budget) {
  uint64_t bytes = 0;
  for (const uint32_t page : residency.resident_pages()) bytes += asset.page_bytes(page);
  expect(bytes <= budget, "more pages in memory than the budget holds");
  for (const umbel::StreamCluster& shown : residency.cut()) {
    const auto page = residency.page(shown.page);
    expect(page && shown.group < page->groups.size() &&
               shown.cluster < page->groups[shown.group].clusters.size(),
           "a cluster is shown that is not there");
  }
}

void step(Input& in, const umbel::Asset& asset, umbel::Residency& residency, uint64_t budget) {
  std::vector<umbel::StreamView> views(1 + in.below(2));
  double now = 0;
  for (uint32_t i = in.below(24); i-- > 0;) {
    for (umbel::StreamView& view : views)
      if (in.below(3)) view = any_view(in);
    now += in.seldom(8) ? 100.0 : 0.05;
    try {
      residency.step(views, now);
    } catch (const umbel::Error& error) {
      expect(error.code() == umbel::ErrorCode::kInvalidArgument, "a step fails of itself");
      continue;
    }
    check(asset, residency, budget);
    if (in.seldom(8)) residency.retry_failed();
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  Input in(data, size);
  const Bytes& chosen = assets()[in.below(2)];
  std::vector<std::byte> bytes(chosen.size());
  std::memcpy(bytes.data(), chosen.data(), chosen.size());
  const umbel::Asset asset(umbel::from_memory(std::move(bytes)));
  umbel::ResidencyConfig config;
  config.budget_bytes = chosen.size() * (1 + in.below(8)) / 8;
  config.loads_in_flight = 1 + in.below(8);
  config.groups_per_step = in.below(2) ? 4096 : 1 + in.below(40);
  config.evictions_per_step = 1 + in.below(8);
  if (in.likes(1)) config.bytes_per_step = in.bytes.integral<uint16_t>();
  try {
    umbel::Residency residency(asset, config, std::make_unique<Loader>(asset, in));
    step(in, asset, residency, config.budget_bytes);
  } catch (const umbel::Error& error) {
    expect(error.code() == umbel::ErrorCode::kInvalidArgument, "a residency fails of itself");
  }
  return 0;
}
