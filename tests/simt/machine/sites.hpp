// The places in kernels where threads wait for each other or order memory, and which of them to
// pass over: how scripts/simt_mutations.py finds out whether tests miss them.
//
//   SIMT_SITES=FILE   writes the kind and the address of each place that was reached, at the end
//   SIMT_SKIP=A,B     does nothing at these addresses
#pragma once

#include <cstdint>

namespace umbel::simt {

enum class SiteKind : uint32_t { kBlock, kWarp, kGrid, kFence, kRelease };

/// Notes a place; whether to pass it over. `caller` is an address behind a call.
bool is_skipped(SiteKind kind, const void* caller);

}  // namespace umbel::simt
