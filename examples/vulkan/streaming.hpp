// The residency of a page pool.
#pragma once

#include <memory>
#include <umbel/umbel.hpp>

namespace sample {

/// As many pages as the pool has slots. Few pages are much smaller than the largest, so that nearly
/// none lacks a slot; one that does is not usable until another leaves.
inline std::unique_ptr<umbel::Residency> make_residency(const umbel::Asset& asset, uint32_t slots) {
  umbel::ResidencyConfig config;
  config.budget_bytes = uint64_t{slots} * asset.info().page_bytes;
  return std::make_unique<umbel::Residency>(asset, config);
}

}  // namespace sample
