// What a C caller holds of an asset.
#pragma once

#include "umbel/asset.hpp"
#include "umbel/umbel_asset.h"

struct umbel_asset {
  umbel::Asset asset;
};
