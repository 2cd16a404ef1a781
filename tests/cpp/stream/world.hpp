// A surface in small pages, and a loader that does what it is told.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "asset/scratch.hpp"
#include "base/math.hpp"
#include "lod/verify/edge_count.hpp"
#include "lod/verify/verify_geometry.hpp"
#include "umbel/stream.hpp"

namespace umbel::testing {

/// How small what is written is.
struct Sizes {
  uint32_t triangles, min_group, max_group, page_bytes;
};

inline void write_pages(const std::filesystem::path& path, const Mesh& mesh, const Sizes& sizes) {
  lod::Config config;
  config.max_triangles = sizes.triangles;
  config.min_group = sizes.min_group;
  config.max_group = sizes.max_group;
  AssetConfig stored;
  stored.page_bytes = sizes.page_bytes;
  write_asset(path, lod::build(mesh.view(), config), "{}", {}, stored);
}

/// A surface of some 80,000 triangles in pages of 16 KiB, and the edges of all its clusters.
class World {
 public:
  World() : asset_(written()), progress_(options_) {
    lod::Findings findings(report_);
    topology_ = lod::read_topology(
        asset_.tables(), [&](uint32_t c) { return asset_.geometry(c); }, {}, findings, progress_);
  }

  const Asset& asset() const { return asset_; }
  std::filesystem::path path() const { return scratch_ / "a.umbel"; }
  uint64_t bytes() const {
    uint64_t all = 0;
    for (uint32_t p = 0; p < asset_.info().pages; ++p) all += asset_.page_bytes(p);
    return all;
  }

  std::vector<uint32_t> clusters(const Residency& residency) const {
    std::vector<uint32_t> cut;
    for (const StreamCluster& c : residency.cut()) {
      const auto page = residency.page(c.page);
      EXPECT_NE(page, nullptr);
      cut.push_back(page->groups[c.group].group.clusters.offset + c.cluster);
    }
    std::sort(cut.begin(), cut.end());
    return cut;
  }

  /// Every edge of what is shown has two triangles.
  void expect_whole(const Residency& residency) {
    lod::EdgeCount edges(topology_);
    uint32_t bad_edges = 0;
    const std::vector<uint32_t> cut = clusters(residency);
    EXPECT_FALSE(cut.empty());
    EXPECT_EQ(std::adjacent_find(cut.begin(), cut.end()), cut.end());
    edges.count(cut, [&](const lod::BadEdge&) { ++bad_edges; });
    EXPECT_EQ(bad_edges, 0u);
  }

 private:
  std::filesystem::path written() {
    write_pages(scratch_ / "a.umbel", shapes::blob(6, 3), {64, 8, 12, 16384});
    return scratch_ / "a.umbel";
  }

  Scratch scratch_;
  Asset asset_;
  lod::VerifyReport report_;
  BuildOptions options_;
  Progress progress_;
  lod::Topology topology_;
};

inline World& world() {
  static World world;
  return world;
}

/// Brings pages when told to, in the order in which they were asked for; may be told to fail.
class Postman : public PageLoader {
 public:
  explicit Postman(const Asset& asset) : asset_(asset) {}
  void request(uint32_t page) override { asked.push_back(page), ++requests[page]; }
  bool cancel(uint32_t page) override { return std::erase(asked, page) > 0; }
  std::vector<PageArrival> poll() override {
    std::vector<PageArrival> brought;
    for (uint32_t i = 0; i < per_poll && !asked.empty(); ++i) {
      const uint32_t page = asked.front();
      asked.erase(asked.begin());
      if (lost.contains(page)) continue;
      if (broken.contains(page))
        brought.push_back({page, nullptr, "page " + std::to_string(page) + " is broken"});
      else
        brought.push_back(read(page));
    }
    return brought;
  }

  PageArrival read(uint32_t page) const {
    try {
      return {page, std::make_shared<const AssetPage>(asset_.read_page(page)), ""};
    } catch (const Error& error) {
      if (!forgives) throw;
      return {page, nullptr, error.what()};
    }
  }

  bool forgives = false;  ///< a page that cannot be read has failed
  uint32_t per_poll = 4;
  std::vector<uint32_t> asked;
  std::map<uint32_t, uint32_t> requests;
  std::set<uint32_t> broken, lost;

 private:
  const Asset& asset_;
};

struct Streamed {
  Postman* postman;
  Residency residency;
  double now = 0;

  explicit Streamed(ResidencyConfig config = {}) : Streamed(config, new Postman(world().asset())) {}
  Streamed(const ResidencyConfig& config, Postman* loader)
      : postman(loader), residency(world().asset(), config, std::unique_ptr<PageLoader>(loader)) {}

  StreamStep step(const lod::View& view) {
    now += 1.0 / 60;
    const StreamView views[] = {{0, view, {}}};
    return residency.step(views, now);
  }
  StreamStep settle(const lod::View& view) {
    StreamStep last;
    for (int i = 0; i < 400; ++i) last = step(view);
    return last;
  }
};

inline lod::View seen_from(const Vec3& eye, float pixels = 1) {
  return lod::view_camera(eye, 1, 1080, pixels);
}

}  // namespace umbel::testing
