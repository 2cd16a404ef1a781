// What a C caller of kd-trees holds.
#pragma once

#include "umbel/kdtree.hpp"
#include "umbel/umbel_kdtree.h"

struct umbel_kdtree {
  umbel::kdtree::KdTree tree;
};
