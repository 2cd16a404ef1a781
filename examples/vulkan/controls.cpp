#include "controls.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "projection.hpp"

namespace sample {

namespace {

constexpr float kStep = 0.08f;             // of the distance to the target, a press
constexpr float kErrorStep = 1.41421356f;  // a press
constexpr float kTurn = 3.1415927f;        // a drag over the whole height
constexpr float kSteepest = 0.999f;        // of a look straight up or down
constexpr uint32_t kLeastBudget = 1, kMostBudget = 1u << 16;

umbel::Vec3 plus(const umbel::Vec3& a, const umbel::Vec3& b, float scale) {
  return {a.x + scale * b.x, a.y + scale * b.y, a.z + scale * b.z};
}

// Rodrigues' formula.
umbel::Vec3 turned(const umbel::Vec3& v, const umbel::Vec3& axis, float angle) {
  const float c = std::cos(angle), s = std::sin(angle), along = (1 - c) * dot(axis, v);
  return plus(plus({c * v.x, c * v.y, c * v.z}, cross(axis, v), s), axis, along);
}

struct Axes {
  umbel::Vec3 right, up, forward;
  float distance;  // to the target
};

Axes axes_of(const umbel::Camera& camera) {
  const umbel::Vec3 away = minus(camera.target, camera.position);
  const umbel::Vec3 forward = unit(away), right = unit(cross(forward, camera.up));
  return {right, cross(right, forward), forward, std::sqrt(dot(away, away))};
}

}  // namespace

Controls::Controls(const FrameInput& start, float size, uint32_t budget_mb)
    : input_(start), home_(start.camera), size_(size), budget_mb_(budget_mb) {}

void Controls::drag(Drag kind, float right, float down) {
  umbel::Camera& camera = input_.camera;
  const Axes axes = axes_of(camera);
  if (kind == Drag::kPan) {
    const float height = 2 * std::tan(camera.fov_y / 2);
    return fly(-right * height, down * height, 0);
  }
  const umbel::Vec3 pole = unit(camera.up);
  umbel::Vec3 back = minus(camera.position, camera.target);
  const umbel::Vec3 tilted = turned(back, axes.right, -kTurn * down);
  if (std::abs(dot(unit(tilted), pole)) < kSteepest) back = tilted;
  camera.position = plus(camera.target, turned(back, pole, -kTurn * right), 1);
}

void Controls::zoom(float notches) {
  umbel::Camera& camera = input_.camera;
  const Axes axes = axes_of(camera);
  const float distance = axes.distance * std::pow(1 - 2 * kStep, notches);
  camera.position =
      plus(camera.target, axes.forward, -std::clamp(distance, 1e-3f * size_, 50 * size_));
}

void Controls::fly(float right, float up, float forward) {
  umbel::Camera& camera = input_.camera;
  const Axes axes = axes_of(camera);
  for (umbel::Vec3* point : {&camera.position, &camera.target}) {
    *point = plus(*point, axes.right, right * axes.distance);
    *point = plus(*point, axes.up, up * axes.distance);
    *point = plus(*point, axes.forward, forward * axes.distance);
  }
}

bool Controls::press(char key) {
  using Looks = FrameInput::Looks;
  switch (key) {
    case 'a':
      fly(-kStep, 0, 0);
      return true;
    case 'd':
      fly(kStep, 0, 0);
      return true;
    case 'q':
      fly(0, -kStep, 0);
      return true;
    case 'e':
      fly(0, kStep, 0);
      return true;
    case 'w':
      fly(0, 0, kStep);
      return true;
    case 's':
      fly(0, 0, -kStep);
      return true;
    case '1':
      input_.looks = Looks::kNormals;
      return true;
    case '2':
      input_.looks = Looks::kClusters;
      return true;
    case '3':
      input_.looks = Looks::kShaded;
      return true;
    case 'o':
      input_.occlusion = !input_.occlusion;
      return true;
    case 'f':
      input_.frozen = !input_.frozen;
      return true;
    case '+':
    case '=':
      input_.pixel_error = std::max(input_.pixel_error / kErrorStep, 0.1f);
      return true;
    case '-':
      input_.pixel_error = std::min(input_.pixel_error * kErrorStep, 1000.0f);
      return true;
    case '[':
    case ']':  // pages are loaded anew, so there is nothing to freeze
      budget_mb_ = key == '[' ? std::max(budget_mb_ / 2, kLeastBudget)
                              : std::min(budget_mb_ * 2, kMostBudget);
      input_.frozen = false;
      return true;
    default:
      return false;
  }
}

std::string Controls::state() const {
  constexpr const char* kLooks[] = {"normals", "clusters", "shaded"};
  char text[128];
  std::snprintf(text, sizeof text, "%s, error %.2f px, %u MB%s%s",
                kLooks[static_cast<uint32_t>(input_.looks)],
                static_cast<double>(input_.pixel_error), budget_mb_,
                input_.occlusion ? "" : ", no occlusion", input_.frozen ? ", frozen" : "");
  return text;
}

}  // namespace sample
