// Ends what begin_avx2.hpp, or a pragma like its own, has begun.
#pragma once

#if defined(__clang__)
#pragma clang attribute pop
#else
#pragma GCC pop_options
#endif
#undef UMBEL_FMA
