#include "umbel/types.hpp"

namespace umbel {

Error::Error(ErrorCode code, const std::string& message)
    : std::runtime_error(message), code_(code) {}

}  // namespace umbel
