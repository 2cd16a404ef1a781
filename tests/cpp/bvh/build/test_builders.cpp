// What holds for every builder at every setting: trees are sound, the same for any threads, within
// their limits; and what is out of range is refused.
#include <gtest/gtest.h>

#include "bvh/tree_tests.hpp"
#include "umbel/bvh_presets.hpp"

namespace umbel::bvh {
namespace {

using Change = void (*)(Config&);

struct Setting {
  const char* name;
  Builder builder;
  Change change = [](Config&) {};
};

Config config_of(const Setting& setting) {
  Config config;
  config.builder = setting.builder;
  setting.change(config);
  return config;
}

constexpr Setting kSettings[] = {
    {"sweep", Builder::kSweep},
    {"binned", Builder::kBinned},
    {"lbvh_30_bits", Builder::kLbvh, [](Config& c) { c.morton_bits = 30; }},
    {"lbvh_60_bits", Builder::kLbvh, [](Config& c) { c.morton_bits = 60; }},
    {"lbvh_63_bits", Builder::kLbvh},
    {"hlbvh_3_bits", Builder::kHlbvh, [](Config& c) { c.hlbvh_bits = 3; }},
    {"hlbvh_15_bits", Builder::kHlbvh},
    {"hlbvh_16_bits", Builder::kHlbvh, [](Config& c) { c.hlbvh_bits = 16; }},
    {"hlbvh_30_bits", Builder::kHlbvh, [](Config& c) { c.hlbvh_bits = 30; }},
    {"kmeans_q1", Builder::kKmeans, [](Config& c) { c.kmeans = kmeans_preset("q1"); }},
    {"kmeans_q2", Builder::kKmeans, [](Config& c) { c.kmeans = kmeans_preset("q2"); }},
    {"kmeans_q3", Builder::kKmeans, [](Config& c) { c.kmeans = kmeans_preset("q3"); }},
    {"kmeans_q4", Builder::kKmeans, [](Config& c) { c.kmeans = kmeans_preset("q4"); }},
    {"kmeans_q5", Builder::kKmeans, [](Config& c) { c.kmeans = kmeans_preset("q5"); }},
    {"kmeans_k2", Builder::kKmeans,
     [](Config& c) { c.kmeans = {.clusters = 2, .candidates = 1, .iterations = 0}; }},
    {"kmeans_k64", Builder::kKmeans,
     [](Config& c) { c.kmeans = {.clusters = 64, .candidates = 64, .iterations = 1}; }},
    {"kmeans_k65", Builder::kKmeans, [](Config& c) { c.kmeans = {.clusters = 65}; }},
    {"kmeans_k300_medians", Builder::kKmeans,
     [](Config& c) { c.kmeans = {.clusters = 300, .distance = KmeansDistance::kManhattan}; }},
    {"kmeans_k1024", Builder::kKmeans, [](Config& c) { c.kmeans = {.clusters = 1024}; }},
    {"kmeans_i100", Builder::kKmeans,
     [](Config& c) { c.kmeans = {.clusters = 3, .candidates = 1, .iterations = 100}; }},
    {"kmeans_k2_medians", Builder::kKmeans,
     [](Config& c) { c.kmeans = {.clusters = 2, .distance = KmeansDistance::kManhattan}; }},
    {"kmeans_k32_medians", Builder::kKmeans,
     [](Config& c) { c.kmeans = {.clusters = 32, .distance = KmeansDistance::kManhattan}; }},
    {"kmeans_k2_hands_up_64", Builder::kKmeans,
     [](Config& c) { c.kmeans = {.clusters = 2, .iterations = 1, .forwarded_clusters = 64}; }},
    {"kmeans_k5_hands_up_1", Builder::kKmeans,
     [](Config& c) { c.kmeans = {.clusters = 5, .iterations = 1, .forwarded_clusters = 1}; }},
    {"kmeans_k33_hands_up_2", Builder::kKmeans,
     [](Config& c) { c.kmeans = {.clusters = 33, .iterations = 1, .forwarded_clusters = 2}; }},
    {"agglomerative", Builder::kAgglomerative},
    {"aac_fast", Builder::kAac},
    {"aac_hq", Builder::kAac, [](Config& c) { c.aac = aac_preset("hq"); }},
    {"aac_pairs", Builder::kAac, [](Config& c) { c.aac = {.leaf_size = 2, .epsilon = 0.5f}; }},
    {"aac_128", Builder::kAac, [](Config& c) { c.aac = {.leaf_size = 128, .epsilon = 0}; }},
    {"ploc_radius_1", Builder::kPloc, [](Config& c) { c.ploc_radius = 1; }},
    {"ploc_radius_16", Builder::kPloc},
    {"ploc_radius_128", Builder::kPloc, [](Config& c) { c.ploc_radius = 128; }},
    {"ploc_as_published", Builder::kPloc, [](Config& c) { c.ploc_sweep = 0; }},
    {"ploc_top_by_sah", Builder::kPloc, [](Config& c) { c.ploc_sweep = 1; }},
    {"atrbvh", Builder::kAtrbvh},
    {"atrbvh_as_published", Builder::kAtrbvh, [](Config& c) { c.atrbvh_bits = 0; }},
    {"atrbvh_treelets_of_3", Builder::kAtrbvh,
     [](Config& c) { c.treelet_size = 3, c.treelet_rounds = 1; }},
    {"atrbvh_treelets_of_15", Builder::kAtrbvh,
     [](Config& c) { c.treelet_size = 15, c.treelet_rounds = 4; }},
    {"atrbvh_16_rounds", Builder::kAtrbvh,
     [](Config& c) { c.treelet_size = 4, c.treelet_rounds = 16; }},
    {"insertion", Builder::kInsertion},
};

class EveryBuilder : public ::testing::TestWithParam<Setting> {};
INSTANTIATE_TEST_SUITE_P(Settings, EveryBuilder, ::testing::ValuesIn(kSettings),
                         [](const auto& info) { return info.param.name; });

TEST_P(EveryBuilder, makes_sound_trees) { expect_sound_builder(config_of(GetParam())); }

TEST_P(EveryBuilder, keeps_leaf_size_and_depth) {
  Config config = config_of(GetParam());
  config.max_leaf_size = 1;
  config.max_depth = 16;
  expect_sound_builder(config);
}

struct Refused {
  Change change;
  const char* sentence;
};

constexpr Refused kRefused[] = {
    {[](Config& c) { c.hlbvh_bits = 2; }, "hlbvh_bits is 2"},
    {[](Config& c) { c.hlbvh_bits = 31; }, "hlbvh_bits is 31"},
    {[](Config& c) { c.kmeans.clusters = 1; }, "kmeans.clusters is 1"},
    {[](Config& c) { c.kmeans.clusters = 1025; }, "kmeans.clusters is 1025"},
    {[](Config& c) { c.kmeans.candidates = 0; }, "kmeans.candidates is 0"},
    {[](Config& c) { c.kmeans.iterations = 101; }, "kmeans.iterations is 101"},
    {[](Config& c) { c.kmeans.forwarded_clusters = 65; }, "kmeans.forwarded_clusters is 65"},
    {[](Config& c) { c.aac.leaf_size = 1; }, "aac.leaf_size is 1"},
    {[](Config& c) { c.aac.epsilon = 0.75f; }, "aac.epsilon is 0.75"},
    {[](Config& c) { c.ploc_radius = 0; }, "ploc_radius is 0"},
    {[](Config& c) { c.ploc_radius = 129; }, "ploc_radius is 129"},
    {[](Config& c) { c.ploc_sweep = 256; }, "ploc_sweep is 256"},
    {[](Config& c) { c.atrbvh_bits = 2; }, "atrbvh_bits is 2"},
    {[](Config& c) { c.atrbvh_bits = 31; }, "atrbvh_bits is 31"},
    {[](Config& c) { c.treelet_size = 2; }, "treelet_size is 2"},
    {[](Config& c) { c.treelet_size = 16; }, "treelet_size is 16"},
    {[](Config& c) { c.treelet_rounds = 0; }, "treelet_rounds is 0"},
    {[](Config& c) { c.treelet_rounds = 17; }, "treelet_rounds is 17"},
};

class BadSettings : public ::testing::TestWithParam<Refused> {};
INSTANTIATE_TEST_SUITE_P(Build, BadSettings, ::testing::ValuesIn(kRefused));

TEST_P(BadSettings, are_refused_by_name_and_value) {
  Config config;
  GetParam().change(config);
  try {
    build(random_boxes(10, 1), config);
    FAIL() << GetParam().sentence;
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kInvalidArgument);
    EXPECT_NE(std::string(error.what()).find(GetParam().sentence), std::string::npos)
        << error.what();
  }
}

}  // namespace
}  // namespace umbel::bvh
