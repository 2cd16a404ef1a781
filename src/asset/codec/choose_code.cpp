#include "asset/codec/choose_code.hpp"

#include <algorithm>
#include <bit>

namespace umbel::asset {
namespace {

/// Bits of all remainders in a Rice or exponential code. With `apart` 1, the remainders are those
/// that are not 0, less 1, and 0 has a class of its own.
template <bool kExponential>
uint64_t bits_of(std::span<const uint32_t> remainders, uint32_t parameter, uint32_t apart) {
  const uint32_t most = kUnaryEscape - apart;
  uint64_t bits = 0;
  for (const uint32_t r : remainders) {
    const uint32_t scaled = r >> parameter;
    if (kExponential) {
      const auto number = static_cast<uint32_t>(std::bit_width(uint64_t{scaled} + 1)) - 1;
      bits += number < most ? 2 * number + 1 + parameter + apart : kUnaryEscape + 32;
    } else {
      bits += scaled < most ? scaled + 1 + parameter + apart : kUnaryEscape + 32;
    }
  }
  return bits;
}

void keep_shorter(const CodeChoice& choice, CodeChoice& best) {
  if (choice.bits < best.bits) best = choice;
}

/// `kind` is 0, or kZeroApart for the remainders that are not 0, less 1. `sum` is of them.
CodeChoice best_rice(std::span<const uint32_t> remainders, uint64_t sum, uint8_t kind) {
  // The best is near the mean's logarithm, or below where outliers have raised the mean.
  const auto near = static_cast<uint32_t>(std::bit_width(sum / remainders.size()));
  CodeChoice best{{0, kind}, ~uint64_t{0}};
  for (uint32_t k = near - std::min(near, 4u); k <= std::min(near + 1, kAllZero - 1); ++k)
    keep_shorter({{static_cast<uint8_t>(k), kind}, bits_of<false>(remainders, k, kind != 0)}, best);
  return best;
}

/// The best is near the parameter of the best Rice code or below, as classes grow.
CodeChoice best_exponential(std::span<const uint32_t> remainders, const RemainderCode& rice) {
  const auto kind = static_cast<uint8_t>(rice.kind | RemainderCode::kExponential);
  const uint32_t most = std::min(uint32_t{rice.parameter}, RemainderCode::kMostExponential);
  CodeChoice best{{0, kind}, ~uint64_t{0}};
  for (uint32_t k = most + 1; k-- > 0;) {
    const uint64_t bits = bits_of<true>(remainders, k, rice.is_zero_apart());
    if (bits >= best.bits) break;
    best = {{static_cast<uint8_t>(k), kind}, bits};
  }
  return best;
}

}  // namespace

CodeChoices CodeChooser::choose(std::span<const uint32_t> remainders) {
  uint64_t sum = 0;
  for (const uint32_t r : remainders) sum += r;
  const CodeChoice all_zero{{kAllZero, 0}, 0};
  if (sum == 0) return {all_zero, all_zero};
  const CodeChoice rice = best_rice(remainders, sum, 0);
  CodeChoices best{rice, rice};
  keep_shorter(best_exponential(remainders, rice.code), best.any);
  others_.resize(remainders.size());
  size_t others = 0;
  for (const uint32_t r : remainders) {
    others_[others] = r - 1;
    others += r != 0;
  }
  // Where 0 is apart, it takes one bit, and any other number one more than before.
  const size_t zeros = remainders.size() - others;
  if (zeros * rice.code.parameter <= others / 2) return best;
  const auto rest = std::span(others_).first(others);
  const CodeChoice apart = best_rice(rest, sum - others, RemainderCode::kZeroApart);
  for (CodeChoice choice : {apart, best_exponential(rest, apart.code)}) {
    choice.bits += zeros;
    keep_shorter(choice, best.any);
  }
  return best;
}

}  // namespace umbel::asset
