// How long a stage of a build takes.
#pragma once

#include <string>

namespace bench {

struct StageTime {
  std::string name;
  double milliseconds;
};

}  // namespace bench
