// What the mouse and the keys change: the camera and how a frame is drawn. As in the web viewer.
#pragma once

#include <cstdint>
#include <string>

#include "frame.hpp"

namespace sample {

enum class Drag { kOrbit, kPan };

class Controls {
 public:
  /// `size`: of what there is to see; no step comes nearer to the target than a part of it.
  Controls(const FrameInput& start, float size, uint32_t budget_mb);

  /// By parts of the window's height.
  void drag(Drag kind, float right, float down);
  /// Nearer by notches of a wheel.
  void zoom(float notches);
  /// Camera and target by parts of their distance, along the camera's axes.
  void fly(float right, float up, float forward);
  /// A letter, a digit or a sign. False if it means nothing.
  bool press(char key);
  /// Back to where it started.
  void home() { input_.camera = home_; }

  const FrameInput& input() const { return input_; }
  uint32_t budget_mb() const { return budget_mb_; }
  /// Error, looks, budget, and whether the clusters are frozen, in a line.
  std::string state() const;

 private:
  FrameInput input_;
  umbel::Camera home_;
  float size_;
  uint32_t budget_mb_;
};

/// Both lists of what the controls take, for --help and the start of the window.
inline constexpr const char* kControlsHelp =
    "drag: turn; right drag: move; wheel: nearer, farther; arrows or A D: left, right, up, down; "
    "Q E: down, up;\nPage up, down or W S: forward, back; Home: the first view; + -: error; [ ]: "
    "budget; 1 2 3: normals, clusters, shaded;\nO: occlusion; F: freeze the clusters; Escape: end";

}  // namespace sample
