// Where the time of k-means goes, by the stages of the charts in Meister & Bittner 2016.
#pragma once

#include <chrono>

namespace umbel::bvh {

/// Seconds by the wall clock, while all threads work on the stage.
struct KmeansTimes {
  double boxes = 0;          ///< the scene's box, and the primitives' in the builder's own arrays
  double seeding = 0;        ///< choosing representatives
  double iterations = 0;     ///< assigning primitives and moving representatives
  double sizes = 0;          ///< of the new clusters, and where each goes
  double reordering = 0;     ///< moving primitives to their clusters
  double agglomeration = 0;  ///< binary trees, with the boxes of their nodes
};

/// Adds the time since the last lap, or since it was made, to a stage.
class StageClock {
 public:
  void lap(double& stage) {
    const auto now = std::chrono::steady_clock::now();
    stage += std::chrono::duration<double>(now - last_).count();
    last_ = now;
  }

 private:
  std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
};

}  // namespace umbel::bvh
