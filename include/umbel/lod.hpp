// Continuous level of detail: building a DAG of clusters, selecting cuts of it, verifying it.
#pragma once

#include "umbel/lod/build.hpp"
#include "umbel/lod/select.hpp"
#include "umbel/lod/types.hpp"
#include "umbel/lod/verify.hpp"
